// The regularised Jacobian J', and what an energy says of itself in terms of it.
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

/// What some energies take of J', and what takes as long as all else that they do.
enum class JacobianFunction { None, Logarithm, InverseCubeRoot };

template <JacobianFunction which, class T>
HWY_INLINE T jacobian_function(T positive) {
  if constexpr (which == JacobianFunction::Logarithm) return logarithm(positive);
  if constexpr (which == JacobianFunction::InverseCubeRoot) return inverse_cube_root(positive);
  return number<T>(0);
}

/// J = det F, s = √(J² + δ²) and J' = (J + s)/2, which is positive for every J where δ > 0, and J itself where δ = 0 <
/// J (Turner, Peiró, Moxey 2016, section 3.2). dJ'/dJ = J'/s.
template <class T>
struct Regularised {
  T J, s, positive;
  T function;  ///< jacobian_function(J'), for the energy that takes it.
};

/// For J < 0 the sum J + s cancels (energies of −2e7 were seen), so there J' = δ²/(2 (s − J)), which is the same
/// number.
template <JacobianFunction function, class T>
HWY_INLINE Regularised<T> regularised(T J, T delta_squared) {
  const T half = number<T>(0.5);
  const T s = square_root(fused(J, J, delta_squared));
  const T magnitude = half * (s + where_negative(J, negative(J), J));
  const T positive = where_negative(J, number<T>(0.25) * delta_squared / magnitude, magnitude);
  return {J, s, positive, jacobian_function<function>(positive)};
}

/// f(Q, J') and its derivatives with respect to Q and J (not J'), where Q is |F|² or |cof F|² as the energy says.
template <class T>
struct Partials {
  T f, f_Q, f_J, f_QQ, f_QJ, f_JJ;
};

/// Which quadratic invariant an energy depends on beside J.
enum class Quadratic {
  Deformation,  ///< Q = |F|²
  Cofactor,     ///< Q = |cof F|²
};

/// Which μ E:E an energy adds to f(Q, J').
enum class StrainTerm { None, Small, GreenLagrange };

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
