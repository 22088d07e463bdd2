// What products with the Hessian need of each quadrature point: F in 16 bits, and partial derivatives of the energy
// (kept_partials-inl.h).
#if defined(VARIMESH_HESSIAN_KEPT_POINTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_KEPT_POINTS_INL_H
#undef VARIMESH_HESSIAN_KEPT_POINTS_INL_H
#else
#define VARIMESH_HESSIAN_KEPT_POINTS_INL_H
#endif

#include <cstddef>
#include <cstdint>

#include "core/kernels/hessian/float_matrix-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// What linearise() has kept of the points of a batch, for the cells in the lanes from `lane` on.
template <int d>
class KeptPoints {
 public:
  /// @param partials  BatchSet::linearisation of the batch
  /// @param steps     BatchSet::deformation of the batch
  /// @param mean      BatchSet::mean of the batch
  HWY_INLINE KeptPoints(const float* partials, int entries, const std::int16_t* steps, const float* mean, int lane)
      : partials_(partials + lane),
        steps_(steps + lane),
        mean_(mean + lane),
        entries_(static_cast<std::size_t>(entries)) {}
  /// Set: BatchSet.
  template <class Set>
  HWY_INLINE KeptPoints(const Set& set, std::int32_t b, int lane)
      : KeptPoints(set.linearisation.data() + b * set.linearisation_size(), set.entries,
                   set.deformation.data() + b * set.deformation_size(),
                   set.mean.data() + static_cast<std::size_t>(b) * (d * d + 1) * kBatch, lane) {}
  /// F at the point of a slot.
  HWY_INLINE FloatMatrix<d> deformation(int slot) const {
    const Floats step = load(mean_ + d * d * kBatch);
    FloatMatrix<d> F;
    unrolled<d>([&](auto i) {
      unrolled<d>([&](auto j) {
        const std::int16_t* steps = steps_ + (static_cast<std::size_t>(slot) * d * d + i * d + j) * kBatch;
        const Floats count = hn::ConvertTo(
            FloatTag(),
            hn::PromoteTo(hn::Rebind<std::int32_t, FloatTag>(), hn::Load(hn::Rebind<std::int16_t, FloatTag>(), steps)));
        F.at[i][j] = hn::MulAdd(count, step, load(mean_ + (i * d + j) * kBatch));
      });
    });
    return F;
  }
  /// The partial derivatives at the point of a slot, as KeptPartials numbers them: entries × lane.
  HWY_INLINE const float* partials(int slot) const {
    return partials_ + static_cast<std::size_t>(slot) * entries_ * kBatch;
  }

 private:
  const float* partials_;
  const std::int16_t* steps_;
  const float* mean_;
  const std::size_t entries_;
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
