// What products with the Hessian need of each quadrature point: F in 16 bits, and partial derivatives of the energy.
#if defined(VARIMESH_HESSIAN_KEPT_POINTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_KEPT_POINTS_INL_H
#undef VARIMESH_HESSIAN_KEPT_POINTS_INL_H
#else
#define VARIMESH_HESSIAN_KEPT_POINTS_INL_H
#endif

#include "core/energy/jacobian-inl.h"
#include "core/kernels/hessian/batches.h"
#include "core/kernels/hessian/float_matrix-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// The partial derivatives of the energy that are kept per point, and where each is: those of KeptPartial, then w f_QJ,
/// w f_QQ and w if the energy needs them. w is the weight times |det A| times the cell's energy_slope.
template <class E>
struct KeptPartials {
  static constexpr int kQ = static_cast<int>(KeptPartial::Q), kJ = static_cast<int>(KeptPartial::J);
  static constexpr int kJJ = static_cast<int>(KeptPartial::JJ);
  static constexpr int kQJ = kJJ + 1;
  static constexpr int kQQ = kQJ + (E::kMixed ? 1 : 0);
  static constexpr int kW = kQQ + (E::kCurved ? 1 : 0);
  static constexpr int kEntries = kW + (E::kStrain != StrainTerm::None ? 1 : 0);
};

/// What linearise() has kept of the points of batch `b`, for the cells in the lanes from `lane` on.
template <int d>
class KeptPoints {
 public:
  HWY_INLINE KeptPoints(const BatchSet& set, std::int32_t b, int lane)
      : partials_(set.linearisation.data() + b * set.linearisation_size() + lane),
        steps_(set.deformation.data() + b * set.deformation_size() + lane),
        mean_(set.mean.data() + static_cast<std::size_t>(b) * (d * d + 1) * kBatch + lane),
        entries_(static_cast<std::size_t>(set.entries)) {}
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
