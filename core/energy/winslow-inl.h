// Winslow: W = Q/J, where Q = |F|², or in the true form in 3-D Q = |cof F|²
// Turner, Peiró, Moxey 2016, section 3.1. The Winslow functional is the integral of |∇χ⁻¹|² over the physical domain.
// Over the straight-sided domain this is the integral of |F⁻¹|² J = |cof F|²/J. In 2-D |cof F| = |F|. In 3-D the form
// of the paper, |F|²/J, is another functional: if F = 1 is scaled up, it decreases, and the Winslow functional
// increases.
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
struct WinslowEnergy : EnergyProperties {
  static constexpr Quadratic kQuadratic =
      d == 3 && form == Winslow::True ? Quadratic::Cofactor : Quadratic::Deformation;
  static constexpr bool kMixed = true;

  explicit WinslowEnergy(const Material&) {}

  /// f = Q/J'
  template <class T>
  HWY_INLINE T value(T Q, const Regularised<T>& j) const {
    return Q / j.positive;
  }

  /// f_Q = 1/J',  f_J = −Q/(J' s),  f_QJ = −1/(J' s),  f_JJ = 2 Q/s³. For δ = 0 < J
  /// this is Q (1/J)'' = 2 Q/J³, because s = J' = J.
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
