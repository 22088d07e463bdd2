// Vectors at the nodes of a batch's cells, one cell per lane: read from the free nodes, and written to the cells'
// contributions.
#if defined(VARIMESH_HESSIAN_CELL_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_CELL_LANES_INL_H
#undef VARIMESH_HESSIAN_CELL_LANES_INL_H
#else
#define VARIMESH_HESSIAN_CELL_LANES_INL_H
#endif

#include "core/kernels/hessian/float_matrix-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <int d>
class CellLanes {
 public:
  /// u[(n d + i) kBatch + lane] = direction of component i of node n of the lane's cell.
  static HWY_INLINE void gather(const std::int32_t* ranks, int nodes, const float* direction, float* u) {
    for (int n = 0; n < nodes; ++n)
      if constexpr (kTurns)
        for (int lane = 0; lane < kBatch; lane += static_cast<int>(hn::Lanes(FloatTag())))
          gather_node(ranks + n * kBatch + lane, direction, u + n * d * kBatch + lane);
      else
        for (int lane = 0; lane < kBatch; ++lane) {
          const float* from = direction + static_cast<std::size_t>(ranks[n * kBatch + lane]) * d;
          unrolled<d>([&](auto i) { u[(n * d + i) * kBatch + lane] = from[i]; });
        }
  }

  /// Rearranges component-wise lanes of sixteen cells into one vector after another. Adding up the cells of a node then
  /// reads one cache line per cell.
  static HWY_INLINE void interleave(const float* vectors, int nodes, float* result) {
    const FloatTag tag;
    for (int n = 0; n < nodes; ++n)
      for (int lane = 0; lane < kBatch; lane += static_cast<int>(hn::Lanes(tag))) {
        const float* from = vectors + n * d * kBatch + lane;
        float* to = result + (n * kBatch + lane) * d;
        if constexpr (d == 2)
          hn::StoreInterleaved2(load(from), load(from + kBatch), tag, to);
        else
          hn::StoreInterleaved3(load(from), load(from + kBatch), load(from + 2 * kBatch), tag, to);
      }
  }

 private:
#if HWY_TARGET == HWY_SCALAR || HWY_HAVE_SCALABLE
  static constexpr bool kTurns = false;
  static HWY_INLINE void gather_node(const std::int32_t*, const float*, float*) {}
#else
  static constexpr bool kTurns = d == 3;

  /// Reads four numbers per lane and transposes each group of four lanes. The last of the four is not needed.
  static HWY_INLINE void gather_node(const std::int32_t* ranks, const float* direction, float* u) {
    const FloatTag tag;
    const Floats a = every_fourth(tag, ranks, direction), b = every_fourth(tag, ranks + 1, direction);
    const Floats c = every_fourth(tag, ranks + 2, direction), e = every_fourth(tag, ranks + 3, direction);
    const Floats ac = hn::InterleaveLower(tag, a, c), be = hn::InterleaveLower(tag, b, e);
    hn::Store(hn::InterleaveLower(tag, ac, be), tag, u);
    hn::Store(hn::InterleaveUpper(tag, ac, be), tag, u + kBatch);
    hn::Store(hn::InterleaveLower(tag, hn::InterleaveUpper(tag, a, c), hn::InterleaveUpper(tag, b, e)), tag,
              u + 2 * kBatch);
  }

  /// The vectors of nodes ranks[0], ranks[4], … side by side.
  template <class D>
  static HWY_INLINE hn::Vec<D> every_fourth(D tag, const std::int32_t* ranks, const float* direction) {
    if constexpr (hn::MaxLanes(tag) == 4) {
      return hn::LoadU(tag, direction + static_cast<std::size_t>(ranks[0]) * 3);
    } else {
      const hn::Half<D> half;
      return hn::Combine(tag, every_fourth(half, ranks + hn::MaxLanes(half), direction),
                         every_fourth(half, ranks, direction));
    }
  }
#endif
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
