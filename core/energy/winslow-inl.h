// Winslow: W = Q/J, with Q = |F|² (the paper's) or, in 3-D, Q = |cof F|² (the true one)
// Turner, Peiró, Moxey 2016, section 3.1. The Winslow functional is |∇χ⁻¹|² over the physical domain, |F⁻¹|² J over the
// straight-sided one, and that is |cof F|²/J in 3-D; in 2-D |cof F| = |F|. The paper's |F|²/J is another functional in
// 3-D: it falls when F = 1 is scaled up, the true one rises.
#if defined(VARIMESH_ENERGY_WINSLOW_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_ENERGY_WINSLOW_INL_H
#undef VARIMESH_ENERGY_WINSLOW_INL_H
#else
#define VARIMESH_ENERGY_WINSLOW_INL_H
#endif

#include "core/energy/jacobian-inl.h"
#include "core/energy/material.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <int d, Winslow form>
struct WinslowEnergy {
  static constexpr Quadratic kQuadratic =
      d == 3 && form == Winslow::True ? Quadratic::Cofactor : Quadratic::Deformation;
  static constexpr StrainTerm kStrain = StrainTerm::None;
  static constexpr JacobianFunction kFunction = JacobianFunction::None;
  static constexpr bool kBarrier = true;
  static constexpr bool kTraceOfStrain = false;
  static constexpr bool kMixed = true;    ///< f_QJ ≠ 0
  static constexpr bool kCurved = false;  ///< f_QQ ≠ 0

  explicit WinslowEnergy(const Material&) {}

  /// f = Q/J'
  template <class T>
  HWY_INLINE T value(T Q, const Regularised<T>& j) const {
    return Q / j.positive;
  }

  /// f_Q = 1/J',  f_J = −Q/(J' s),  f_QJ = −1/(J' s),  f_JJ = 2 Q/s³ — for δ = 0 < J the limit of
  /// (1/J')'' = 2/s³ is what is wanted, since s = J = J' there.
  template <class T>
  HWY_INLINE Partials<T> partials(T Q, const Regularised<T>& j) const {
    const T inverse = number<T>(1) / j.positive;
    const T inverse_s = number<T>(1) / j.s;
    const T mixed = negative(inverse) * inverse_s;
    return {Q * inverse, inverse, Q * mixed, number<T>(0), mixed, number<T>(2) * Q * inverse_s * inverse_s * inverse_s};
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
