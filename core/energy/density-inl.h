// W(F), dW/dF and d²W/dF² from an energy's f(Q, J'), for any type of number. The plain code uses doubles, and the tests
// use quadruple precision.
#if defined(VARIMESH_ENERGY_DENSITY_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_ENERGY_DENSITY_INL_H
#undef VARIMESH_ENERGY_DENSITY_INL_H
#else
#define VARIMESH_ENERGY_DENSITY_INL_H
#endif

#include <array>

#include "core/energy/table-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// A d × d matrix of numbers of any type.
template <class T, int d>
using Matrix = std::array<std::array<T, d>, d>;

/// C = cof F = ∂J/∂F.
template <int d, class T>
Matrix<T, d> cofactor(const Matrix<T, d>& F) {
  Matrix<T, d> C;
  if constexpr (d == 2) {
    C = {{{F[1][1], negative(F[1][0])}, {negative(F[0][1]), F[0][0]}}};
  } else {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        C[i][j] = F[i1][j1] * F[i2][j2] - F[i1][j2] * F[i2][j1];
      }
  }
  return C;
}

/// ∂C_ij/∂F_kl: constant in 2-D, an entry of ±F in 3-D.
template <int d, class T>
T cofactor_derivative(const Matrix<T, d>& F, int i, int j, int k, int l) {
  if constexpr (d == 2) {
    if (k == 1 - i && l == 1 - j) return number<T>(i == j ? 1.0 : -1.0);
    return number<T>(0);
  } else {
    if (k == i || l == j) return number<T>(0);
    // The third row and column, and the sign of the permutations (i, k, m) and (j, l, n).
    const int m = 3 - i - k, n = 3 - j - l;
    const double sign = ((k - i + 3) % 3 == 1 ? 1 : -1) * ((l - j + 3) % 3 == 1 ? 1 : -1);
    return number<T>(sign) * F[m][n];
  }
}

template <int d, class T>
T determinant(const Matrix<T, d>& F) {
  const Matrix<T, d> C = cofactor<d>(F);
  T J = number<T>(0);
  for (int j = 0; j < d; ++j) J = J + F[0][j] * C[0][j];
  return J;
}

template <int d, class T>
T dot(const Matrix<T, d>& A, const Matrix<T, d>& B) {
  T sum = number<T>(0);
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) sum = sum + A[i][j] * B[i][j];
  return sum;
}

/// The strain E: Green–Lagrange, (FᵀF − 1)/2, or small, (F + Fᵀ)/2 − 1.
template <int d, class T>
Matrix<T, d> strain_of(const Matrix<T, d>& F, StrainTerm term) {
  Matrix<T, d> E;
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) {
      T sum = F[i][j] + F[j][i];
      if (term == StrainTerm::GreenLagrange) {
        sum = number<T>(0);
        for (int k = 0; k < d; ++k) sum = sum + F[k][i] * F[k][j];
      }
      E[i][j] = number<T>(0.5) * (sum - number<T>(i != j ? 0 : term == StrainTerm::GreenLagrange ? 1 : 2));
    }
  return E;
}

/// tr F − d
template <int d, class T>
T trace_of_small_strain(const Matrix<T, d>& F) {
  T sum = number<T>(-d);
  for (int i = 0; i < d; ++i) sum = sum + F[i][i];
  return sum;
}

/// W(F).
template <int d, class T, class E>
T density_value(const E& energy, const Matrix<T, d>& F, T delta_squared) {
  const Matrix<T, d> C = cofactor<d>(F);
  const T Q = E::kQuadratic == Quadratic::Cofactor ? dot<d>(C, C) : dot<d>(F, F);
  T W = energy.value(Q, regularised<E::kFunction>(determinant<d>(F), delta_squared));
  if constexpr (E::kStrain != StrainTerm::None) {
    const Matrix<T, d> strain = strain_of<d>(F, E::kStrain);
    W = W + number<T>(energy.mu) * dot<d>(strain, strain);
    const T trace = trace_of_small_strain<d>(F);
    if constexpr (E::kTraceOfStrain) W = W + number<T>(0.5 * energy.lambda) * trace * trace;
  }
  return W;
}

/// P = dW/dF = f_Q dQ/dF + f_J C + the derivative of the strain terms, with d|F|²/dF = 2F and d|C|²/dF : dF = 2 C : dC.
/// `C` is cof F, and `p` are the partial derivatives of f at F.
template <int d, class T, class E>
Matrix<T, d> density_gradient(const E& energy, const Matrix<T, d>& F, const Matrix<T, d>& C, const Partials<T>& p) {
  Matrix<T, d> P;
  for (int k = 0; k < d; ++k)
    for (int l = 0; l < d; ++l) {
      T dQ = number<T>(2) * F[k][l];
      if constexpr (E::kQuadratic == Quadratic::Cofactor) {
        dQ = number<T>(0);
        for (int i = 0; i < d; ++i)
          for (int j = 0; j < d; ++j) dQ = dQ + number<T>(2) * C[i][j] * cofactor_derivative<d>(F, i, j, k, l);
      }
      P[k][l] = p.f_Q * dQ + p.f_J * C[k][l];
    }
  if constexpr (E::kStrain != StrainTerm::None) {
    const Matrix<T, d> strain = strain_of<d>(F, E::kStrain);
    const T two_mu = number<T>(2 * energy.mu);
    for (int k = 0; k < d; ++k)
      for (int l = 0; l < d; ++l) {
        T sum = strain[k][l];  // the small strain: P += 2μE
        if constexpr (E::kStrain == StrainTerm::GreenLagrange) {
          sum = number<T>(0);  // Green–Lagrange: P += 2μFE
          for (int m = 0; m < d; ++m) sum = sum + F[k][m] * strain[m][l];
        }
        P[k][l] = P[k][l] + two_mu * sum;
      }
    if constexpr (E::kTraceOfStrain)
      for (int k = 0; k < d; ++k) P[k][k] = P[k][k] + number<T>(energy.lambda) * trace_of_small_strain<d>(F);
  }
  return P;
}

/// The same for F and δ².
template <int d, class T, class E>
Matrix<T, d> density_gradient(const E& energy, const Matrix<T, d>& F, T delta_squared) {
  const Matrix<T, d> C = cofactor<d>(F);
  const T Q = E::kQuadratic == Quadratic::Cofactor ? dot<d>(C, C) : dot<d>(F, F);
  return density_gradient<d>(energy, F, C,
                             energy.partials(Q, regularised<E::kFunction>(determinant<d>(F), delta_squared)));
}

/// Adds the strain terms' part of (d²W/dF²) : dF to dP.
template <int d, class T, class E>
void add_strain_change(const E& energy, const Matrix<T, d>& F, const Matrix<T, d>& dF, Matrix<T, d>& dP) {
  const Matrix<T, d> strain = strain_of<d>(F, E::kStrain);
  Matrix<T, d> d_strain;
  for (int k = 0; k < d; ++k)
    for (int l = 0; l < d; ++l) {
      T sum = dF[k][l] + dF[l][k];
      if constexpr (E::kStrain == StrainTerm::GreenLagrange) {
        sum = number<T>(0);
        for (int m = 0; m < d; ++m) sum = sum + dF[m][k] * F[m][l] + F[m][k] * dF[m][l];
      }
      d_strain[k][l] = number<T>(0.5) * sum;
    }
  const T two_mu = number<T>(2 * energy.mu);
  for (int k = 0; k < d; ++k)
    for (int l = 0; l < d; ++l) {
      T sum = d_strain[k][l];
      if constexpr (E::kStrain == StrainTerm::GreenLagrange) {
        sum = number<T>(0);
        for (int m = 0; m < d; ++m) sum = sum + dF[k][m] * strain[m][l] + F[k][m] * d_strain[m][l];
      }
      dP[k][l] = dP[k][l] + two_mu * sum;
    }
  if constexpr (E::kTraceOfStrain) {
    T trace = number<T>(0);
    for (int i = 0; i < d; ++i) trace = trace + dF[i][i];
    for (int k = 0; k < d; ++k) dP[k][k] = dP[k][k] + number<T>(energy.lambda) * trace;
  }
}

/// The change dP of P for a change dF of F: (d²W/dF²) : dF.
template <int d, class T, class E>
Matrix<T, d> density_hessian_times(const E& energy, const Matrix<T, d>& F, T delta_squared, const Matrix<T, d>& dF) {
  const Matrix<T, d> C = cofactor<d>(F);
  Matrix<T, d> dC, dQ_dF, d_dQ_dF;  // dQ/dF and its change
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) {
      dC[i][j] = number<T>(0);
      for (int k = 0; k < d; ++k)
        for (int l = 0; l < d; ++l) dC[i][j] = dC[i][j] + cofactor_derivative<d>(F, i, j, k, l) * dF[k][l];
    }
  for (int k = 0; k < d; ++k)
    for (int l = 0; l < d; ++l) {
      dQ_dF[k][l] = number<T>(2) * F[k][l];
      d_dQ_dF[k][l] = number<T>(2) * dF[k][l];
      if constexpr (E::kQuadratic == Quadratic::Cofactor) {
        dQ_dF[k][l] = d_dQ_dF[k][l] = number<T>(0);
        for (int i = 0; i < d; ++i)
          for (int j = 0; j < d; ++j) {
            const T two = number<T>(2);
            dQ_dF[k][l] = dQ_dF[k][l] + two * C[i][j] * cofactor_derivative<d>(F, i, j, k, l);
            // cofactor_derivative is linear in F, so its change along dF is its value at dF.
            d_dQ_dF[k][l] = d_dQ_dF[k][l] + two * (dC[i][j] * cofactor_derivative<d>(F, i, j, k, l) +
                                                   C[i][j] * cofactor_derivative<d>(dF, i, j, k, l));
          }
      }
    }
  const T Q = E::kQuadratic == Quadratic::Cofactor ? dot<d>(C, C) : dot<d>(F, F);
  const Partials<T> p = energy.partials(Q, regularised<E::kFunction>(determinant<d>(F), delta_squared));
  const T dQ = dot<d>(dQ_dF, dF), dJ = dot<d>(C, dF);
  Matrix<T, d> dP;
  for (int k = 0; k < d; ++k)
    for (int l = 0; l < d; ++l)
      dP[k][l] = p.f_Q * d_dQ_dF[k][l] + (p.f_QQ * dQ + p.f_QJ * dJ) * dQ_dF[k][l] +
                 (p.f_QJ * dQ + p.f_JJ * dJ) * C[k][l] + p.f_J * dC[k][l];
  if constexpr (E::kStrain != StrainTerm::None) add_strain_change<d>(energy, F, dF, dP);
  return dP;
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
