// FoldedGradient applied to the cells of a batch, one cell per lane.
#if defined(VARIMESH_HESSIAN_FOLDED_GRADIENT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_FOLDED_GRADIENT_INL_H
#undef VARIMESH_HESSIAN_FOLDED_GRADIENT_INL_H
#else
#define VARIMESH_HESSIAN_FOLDED_GRADIENT_INL_H
#endif

#include "core/kernels/hessian/float_matrix-inl.h"
#include "core/kernels/hessian/folded_gradient.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// Calls body(n) with n as a compile-time constant, for 0 ≤ n ≤ most.
template <int most, class Body>
HWY_INLINE void with_constant(int n, const Body& body) {
  if (n == most)
    body(std::integral_constant<int, most>());
  else if constexpr (most > 0)
    with_constant<most - 1>(n, body);
}

/// Turns members into components, or components into members. The table of signs is symmetric, so both are the same.
template <int mirrors>
HWY_INLINE void add_with_signs(Floats* values) {
  unrolled<mirrors>([&](auto bit) {
    unrolled<(1 << mirrors)>([&](auto member) {
      constexpr int kOne = 1;
      if ((member & (kOne << bit)) == 0) {
        const Floats a = values[member], b = values[member | (kOne << bit)];
        values[member] = a + b;
        values[member | (kOne << bit)] = a - b;
      }
    });
  });
}

/// Arrays over nodes have d vectors of kBatch floats per node. Arrays over slots have d × d such vectors per slot,
/// row-major in (component i, derivative α).
template <int d>
struct FoldedLanes {
  // Rows of the table per pass; the accumulators must fit in registers: AVX-512 has 32, AVX2 and SSE have 16.
  static constexpr int kTile = (HWY_TARGET == HWY_AVX3 ? 24 : 12) / d;

  using Places = std::array<int, 8> FoldedGradient::Orbit::*;

  /// Turns values at nodes into their components.
  static HWY_INLINE void fold(const FoldedGradient& gradient, const float* nodes, float* components) {
    between<&FoldedGradient::Orbit::member, &FoldedGradient::Orbit::component>(gradient, nodes, components);
  }

  /// The transpose of fold().
  static HWY_INLINE void unfold(const FoldedGradient& gradient, const float* components, float* nodes) {
    between<&FoldedGradient::Orbit::component, &FoldedGradient::Orbit::member>(gradient, components, nodes);
  }

  /// Turns the components of an orbit's slots into their values, or back, in place.
  static HWY_INLINE void turn(float* slots, const FoldedGradient::Orbit& orbit) {
    with_constant<d>(orbit.mirrors, [&](auto mirrors) {
      if constexpr (mirrors > 0) turn_slots<mirrors>(slots + orbit.component[0] * d * d * kBatch);
    });
  }

  /// Turns components at nodes into components of the derivatives at points.
  static HWY_INLINE void forward(const FoldedGradient& gradient, const float* components, float* slots) {
    for (const FoldedGradient::Parity& parity : gradient.parities)
      in_tiles(static_cast<int>(parity.rows.size()), [&](auto tile, int row) {
        forward_tile<tile>(parity, row, components + parity.first * d * kBatch, slots);
      });
  }

  /// The transpose of forward().
  static HWY_INLINE void backward(const FoldedGradient& gradient, const float* slots, float* components) {
    for (const FoldedGradient::Parity& parity : gradient.parities)
      in_tiles(parity.nodes, [&](auto tile, int node) {
        backward_tile<tile>(parity, node, slots, components + (parity.first + node) * d * kBatch);
      });
  }

 private:
  template <Places source, Places target>
  static HWY_INLINE void between(const FoldedGradient& gradient, const float* from, float* to) {
    for (const FoldedGradient::Orbit& orbit : gradient.node_orbits)
      with_constant<d>(orbit.mirrors, [&](auto mirrors) {
        unrolled<d>([&](auto i) {
          Floats values[1 << mirrors];
          for (int g = 0; g < 1 << mirrors; ++g) values[g] = load(from + ((orbit.*source)[g] * d + i) * kBatch);
          add_with_signs<mirrors>(values);
          for (int g = 0; g < 1 << mirrors; ++g)
            hn::Store(values[g], FloatTag(), to + ((orbit.*target)[g] * d + i) * kBatch);
        });
      });
  }

  template <int mirrors>
  static HWY_NOINLINE void turn_slots(float* first) {
    for (int entry = 0; entry < d * d; ++entry) {
      float* at = first + entry * kBatch;
      Floats values[1 << mirrors];
      for (int g = 0; g < 1 << mirrors; ++g) values[g] = load(at + g * d * d * kBatch);
      add_with_signs<mirrors>(values);
      for (int g = 0; g < 1 << mirrors; ++g) hn::Store(values[g], FloatTag(), at + g * d * d * kBatch);
    }
  }

  /// Splits `count` rows into tiles of nearly the same size and calls body(size, first) for each.
  template <class Body>
  static HWY_INLINE void in_tiles(int count, const Body& body) {
    const int tiles = (count + kTile - 1) / kTile;
    for (int tile = 0; tile < tiles; ++tile) {
      const int first = count * tile / tiles;
      with_constant<kTile>(count * (tile + 1) / tiles - first, [&](auto size) {
        if constexpr (size > 0) body(size, first);
      });
    }
  }

  template <int tile>
  static HWY_FLATTEN HWY_NOINLINE void forward_tile(const FoldedGradient::Parity& parity, int row,
                                                    const float* components, float* slots) {
    const std::size_t rows = parity.rows.size();
    const float* table = parity.forward.data();  // null if there are no nodes
    Floats sum[tile * d];
    unrolled<tile * d>([&](auto entry) { sum[entry] = hn::Zero(FloatTag()); });
    for (int n = 0; n < parity.nodes; ++n) {
      Floats x[d];
      unrolled<d>([&](auto i) { x[i] = load(components + (n * d + i) * kBatch); });
      unrolled<tile>([&](auto r) {
        const Floats slope = every(table[n * rows + row + r]);
        unrolled<d>([&](auto i) { sum[r * d + i] = hn::MulAdd(x[i], slope, sum[r * d + i]); });
      });
    }
    unrolled<tile>([&](auto r) {
      float* to = slots + parity.rows[row + r] * kBatch;
      unrolled<d>([&](auto i) { hn::Store(sum[r * d + i], FloatTag(), to + i * d * kBatch); });
    });
  }

  template <int tile>
  static HWY_FLATTEN HWY_NOINLINE void backward_tile(const FoldedGradient::Parity& parity, int node, const float* slots,
                                                     float* components) {
    const float* table = parity.backward.data() + node;
    Floats sum[tile * d];
    unrolled<tile * d>([&](auto entry) { sum[entry] = hn::Zero(FloatTag()); });
    for (const int row : parity.rows) {
      const float* from = slots + row * kBatch;
      Floats x[d];
      unrolled<d>([&](auto i) { x[i] = load(from + i * d * kBatch); });
      unrolled<tile>([&](auto n) {
        const Floats slope = every(table[n]);
        unrolled<d>([&](auto i) { sum[n * d + i] = hn::MulAdd(x[i], slope, sum[n * d + i]); });
      });
      table += parity.nodes;
    }
    unrolled<tile>([&](auto n) {
      unrolled<d>([&](auto i) { hn::Store(sum[n * d + i], FloatTag(), components + (n * d + i) * kBatch); });
    });
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
