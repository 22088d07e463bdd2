// The regularised Jacobian J', and the properties that every energy declares.
#if defined(VARIMESH_ENERGY_JACOBIAN_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_ENERGY_JACOBIAN_INL_H
#undef VARIMESH_ENERGY_JACOBIAN_INL_H
#else
#define VARIMESH_ENERGY_JACOBIAN_INL_H
#endif

#include "core/energy/number-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// The function of J' that an energy needs. It takes as long as everything else that the energy computes.
enum class JacobianFunction { None, Logarithm, InverseCubeRoot };

template <JacobianFunction which, class T>
HWY_INLINE T jacobian_function(T positive) {
  if constexpr (which == JacobianFunction::Logarithm) return logarithm(positive);
  if constexpr (which == JacobianFunction::InverseCubeRoot) return inverse_cube_root(positive);
  return number<T>(0);
}

/// J = det F, s = √(J² + δ²) and J' = (J + s)/2 (Turner, Peiró, Moxey 2016, section 3.2). J' is positive for every J if
/// δ > 0. It equals J if δ = 0 and J > 0. Its derivative is dJ'/dJ = J'/s.
template <class T>
struct Regularised {
  T J, s, positive;
  T function;  ///< jacobian_function(J').
};

/// J' for J and δ². For J < 0 the sum J + s would cancel, which has led to energies of −2e7. So for J < 0 this computes
/// the same number as J' = δ²/(2 (s − J)).
template <JacobianFunction function, class T>
HWY_INLINE Regularised<T> regularised(T J, T delta_squared) {
  const T half = number<T>(0.5);
  const T s = square_root(fused(J, J, delta_squared));
  const T magnitude = half * (s + where_negative(J, negative(J), J));
  const T positive = where_negative(J, number<T>(0.25) * delta_squared / magnitude, magnitude);
  return {J, s, positive, jacobian_function<function>(positive)};
}

/// f(Q, J') and its derivatives with respect to Q and J (not J'). The energy's kQuadratic says what Q is.
template <class T>
struct Partials {
  T f, f_Q, f_J, f_QQ, f_QJ, f_JJ;
};

/// The quadratic invariant Q on which an energy depends besides J.
enum class Quadratic {
  Deformation,  ///< Q = |F|²
  Cofactor,     ///< Q = |cof F|²
};

/// The strain E of the term μ E:E that an energy adds to f(Q, J').
enum class StrainTerm { None, Small, GreenLagrange };

/// The properties of an energy, with the values that most energies have. An energy derives from this struct and
/// redefines the properties that differ.
struct EnergyProperties {
  static constexpr Quadratic kQuadratic = Quadratic::Deformation;        ///< What Q is.
  static constexpr StrainTerm kStrain = StrainTerm::None;                ///< Which term μ E:E is added.
  static constexpr JacobianFunction kFunction = JacobianFunction::None;  ///< The function of J' that is needed.
  static constexpr bool kBarrier = true;  ///< W → ∞ as J → 0, so that the energy keeps valid elements valid.
  static constexpr bool kTraceOfStrain = false;  ///< Whether λ/2 (tr E)² is added.
  static constexpr bool kMixed = false;          ///< Whether f_QJ ≠ 0.
  static constexpr bool kCurved = false;         ///< Whether f_QQ ≠ 0.
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
