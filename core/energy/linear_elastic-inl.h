// Linear elastic: W = μ E:E + κ/2 (ln J)², or in the classical form W = μ E:E + λ/2 (tr E)²
// Turner, Peiró, Moxey 2016, section 3.1, use the small strain E = sym F − 1. It is not invariant under rotation, so a
// rotated mesh gives another result. The reference implementation (NekMesh) uses the Green–Lagrange strain
// E = (FᵀF − 1)/2. The classical form has no barrier at J = 0, so it cannot keep a mesh valid.
#if defined(VARIMESH_ENERGY_LINEAR_ELASTIC_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_ENERGY_LINEAR_ELASTIC_INL_H
#undef VARIMESH_ENERGY_LINEAR_ELASTIC_INL_H
#else
#define VARIMESH_ENERGY_LINEAR_ELASTIC_INL_H
#endif

#include "core/energy/jacobian-inl.h"
#include "core/energy/material.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <int d, Strain strain, Volumetric volumetric>
struct LinearElasticEnergy : EnergyProperties {
  static constexpr StrainTerm kStrain = strain == Strain::Small ? StrainTerm::Small : StrainTerm::GreenLagrange;
  static constexpr bool kBarrier = volumetric == Volumetric::Log;
  static constexpr JacobianFunction kFunction = kBarrier ? JacobianFunction::Logarithm : JacobianFunction::None;
  /// Only for the small strain: tr E is linear in F, so (tr E)² is not a function of Q. For the Green–Lagrange strain
  /// it is one, which f contains.
  static constexpr bool kTraceOfStrain = volumetric == Volumetric::Trace && strain == Strain::Small;
  static constexpr bool kCurved = !kBarrier && !kTraceOfStrain;

  double mu, lambda, kappa;
  explicit LinearElasticEnergy(const Material& m) : mu(m.mu), lambda(m.lambda), kappa(m.kappa) {}

  /// Everything except μ E:E and the trace of the small strain: f = κ/2 L², L = ln J', or f = λ/8 (Q − d)², because
  /// tr E = (Q − d)/2 for the Green–Lagrange strain.
  template <class T>
  HWY_INLINE T value(T Q, const Regularised<T>& j) const {
    if constexpr (kBarrier) {
      const T L = j.function;
      return number<T>(0.5 * kappa) * L * L;
    } else if constexpr (kTraceOfStrain) {
      return number<T>(0);
    } else {
      const T excess = Q - number<T>(d);
      return number<T>(0.125 * lambda) * excess * excess;
    }
  }

  /// With the logarithm: f_J = κ L/s,  f_JJ = κ (1 − L J/s)/s².  With the trace: f_Q = λ/4 (Q − d),  f_QQ = λ/4.
  template <class T>
  HWY_INLINE Partials<T> partials(T Q, const Regularised<T>& j) const {
    const T zero = number<T>(0);
    if constexpr (kBarrier) {
      const T L = j.function;
      const T inverse_s = number<T>(1) / j.s;
      const T kappa_L = number<T>(kappa) * L;
      return {number<T>(0.5) * kappa_L * L,
              zero,
              kappa_L * inverse_s,
              zero,
              zero,
              (number<T>(kappa) - kappa_L * j.J * inverse_s) * inverse_s * inverse_s};
    } else if constexpr (kTraceOfStrain) {
      return {zero, zero, zero, zero, zero, zero};
    } else {
      const T excess = Q - number<T>(d);
      return {number<T>(0.125 * lambda) * excess * excess,
              number<T>(0.25 * lambda) * excess,
              zero,
              number<T>(0.25 * lambda),
              zero,
              zero};
    }
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
