// Hyperelastic (neo-Hookean): W = μ/2 (|F|² − d) − μ ln J + λ/2 (ln J)²
// Turner, Peiró, Moxey 2016, section 3.1, with I − d instead of their I − 3, so that W(1) = 0 in both dimensions.
#if defined(VARIMESH_ENERGY_HYPERELASTIC_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_ENERGY_HYPERELASTIC_INL_H
#undef VARIMESH_ENERGY_HYPERELASTIC_INL_H
#else
#define VARIMESH_ENERGY_HYPERELASTIC_INL_H
#endif

#include "core/energy/jacobian-inl.h"
#include "core/energy/material.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <int d>
struct HyperelasticEnergy : EnergyProperties {
  static constexpr JacobianFunction kFunction = JacobianFunction::Logarithm;

  double mu, lambda;
  explicit HyperelasticEnergy(const Material& m) : mu(m.mu), lambda(m.lambda) {}

  /// f = μ/2 (Q − d) − μ L + λ/2 L²,  L = ln J'
  template <class T>
  HWY_INLINE T value(T Q, const Regularised<T>& j) const {
    const T L = j.function;
    return fused(number<T>(0.5 * mu), Q - number<T>(d), L * (number<T>(0.5 * lambda) * L - number<T>(mu)));
  }

  /// f_Q = μ/2,  f_J = (λ L − μ)/s,  f_JJ = [λ − (λ L − μ) J/s]/s²
  template <class T>
  HWY_INLINE Partials<T> partials(T Q, const Regularised<T>& j) const {
    const T L = j.function;
    const T inverse_s = number<T>(1) / j.s;
    const T slope = number<T>(lambda) * L - number<T>(mu);
    const T zero = number<T>(0);
    return {fused(number<T>(0.5 * mu), Q - number<T>(d), L * (number<T>(0.5 * lambda) * L - number<T>(mu))),
            number<T>(0.5 * mu),
            slope * inverse_s,
            zero,
            zero,
            (number<T>(lambda) - slope * j.J * inverse_s) * inverse_s * inverse_s};
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
