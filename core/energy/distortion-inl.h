// Distortion: W = |F|²/(d J^(2/d))
// Turner, Peiró, Moxey 2016, section 3.1 (Roca, Gargallo-Peiró, Sarrate 2011). W is invariant under scaling, and 1 if F
// is a multiple of a rotation. With the ideal target it is the inverse mean ratio. In 2-D it is half the Winslow
// energy.
#if defined(VARIMESH_ENERGY_DISTORTION_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_ENERGY_DISTORTION_INL_H
#undef VARIMESH_ENERGY_DISTORTION_INL_H
#else
#define VARIMESH_ENERGY_DISTORTION_INL_H
#endif

#include "core/energy/jacobian-inl.h"
#include "core/energy/material.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <int d>
struct DistortionEnergy : EnergyProperties {
  static constexpr JacobianFunction kFunction = d == 3 ? JacobianFunction::InverseCubeRoot : JacobianFunction::None;
  static constexpr bool kMixed = true;
  static constexpr double kPower = 2.0 / d;  ///< m

  explicit DistortionEnergy(const Material&) {}

  /// b/d = J'^(−m)/d
  template <class T>
  static HWY_INLINE T scale(const Regularised<T>& j) {
    if constexpr (d == 2) {
      return number<T>(0.5) / j.positive;
    } else {
      return number<T>(1.0 / d) * j.function * j.function;
    }
  }

  /// f = Q b/d,  b = J'^(−m),  m = 2/d
  template <class T>
  HWY_INLINE T value(T Q, const Regularised<T>& j) const {
    return Q * scale(j);
  }

  /// f_Q = b/d,  f_J = −m Q b/(d s),  f_QJ = −m b/(d s),  f_JJ = Q m b (m + J/s)/(d s²)
  template <class T>
  HWY_INLINE Partials<T> partials(T Q, const Regularised<T>& j) const {
    const T b = scale(j);
    const T inverse_s = number<T>(1) / j.s;
    const T mixed = number<T>(-kPower) * b * inverse_s;
    return {Q * b,        b,     Q * mixed,
            number<T>(0), mixed, negative(Q) * mixed * (number<T>(kPower) + j.J * inverse_s) * inverse_s};
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
