// Linear elastic: W = μ E:E + κ/2 (ln J)², or in the classical form W = μ E:E + λ/2 (tr E)²
// Turner, Peiró, Moxey 2016, section 3.1, have the small strain E = sym F − 1, which is not invariant under rotation:
// a rotated mesh gives another result. The reference implementation (NekMesh) takes Green–Lagrange's,
// E = (FᵀF − 1)/2. The classical form has no barrier at J = 0: it cannot keep a mesh valid.
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
struct LinearElasticEnergy {
  static constexpr Quadratic kQuadratic = Quadratic::Deformation;
  static constexpr StrainTerm kStrain =
      strain == Strain::Small ? StrainTerm::Small : StrainTerm::GreenLagrange;  ///< μ E:E
  static constexpr bool kBarrier = volumetric == Volumetric::Log;
  static constexpr JacobianFunction kFunction = kBarrier ? JacobianFunction::Logarithm : JacobianFunction::None;
  /// λ/2 (tr E)² of the small strain, which is linear in F and so no function of Q; of Green–Lagrange's it is one.
  static constexpr bool kTraceOfStrain = volumetric == Volumetric::Trace && strain == Strain::Small;

  static constexpr bool kMixed = false;                          ///< f_QJ ≠ 0
  static constexpr bool kCurved = !kBarrier && !kTraceOfStrain;  ///< f_QQ ≠ 0

  double mu, lambda, kappa;
  explicit LinearElasticEnergy(const Material& m) : mu(m.mu), lambda(m.lambda), kappa(m.kappa) {}

  /// The part beside μ E:E: κ/2 L², or λ/8 (Q − d)² since tr E = (Q − d)/2 for Green–Lagrange's strain.
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

  /// Logarithm: f_J = κ L/s,  f_JJ = κ (1 − L J/s)/s². Trace: f_Q = λ/4 (Q − d),  f_QQ = λ/4.
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
