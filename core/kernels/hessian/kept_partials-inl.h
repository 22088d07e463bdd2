// The partial derivatives of an energy that products with the Hessian need of each quadrature point.
#if defined(VARIMESH_HESSIAN_KEPT_PARTIALS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_KEPT_PARTIALS_INL_H
#undef VARIMESH_HESSIAN_KEPT_PARTIALS_INL_H
#else
#define VARIMESH_HESSIAN_KEPT_PARTIALS_INL_H
#endif

#include "core/energy/jacobian-inl.h"
#include "core/kernels/hessian/batch.h"

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

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
