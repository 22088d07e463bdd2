// Gauss–Jacobi rules: the eigenvalues of Golub and Welsch, refined by Newton's method to the precision of a double.
#include <Eigen/Eigenvalues>
#include <cassert>
#include <cmath>

#include "core/reference/quadrature.h"

namespace varimesh::reference {
namespace {

/// The coefficients of the recurrence of the orthonormal polynomials, √β_{k+1} p_{k+1} = (x − α_k) p_k − √β_k p_{k−1}.
/// β_0 is the integral of the weight. W. Gautschi, Orthogonal Polynomials: Computation and Approximation, 2004,
/// table 1.1.
struct Recurrence {
  Eigen::VectorXd alpha, beta;
};

Recurrence recurrence(int n, double a, double b) {
  Recurrence r{Eigen::VectorXd(n), Eigen::VectorXd(n + 1)};
  r.beta[0] = std::exp2(a + b + 1) * std::tgamma(a + 1) * std::tgamma(b + 1) / std::tgamma(a + b + 2);
  for (int k = 0; k < n; ++k) {
    const double s = 2 * k + a + b;
    r.alpha[k] = k == 0 ? (b - a) / (a + b + 2) : (b * b - a * a) / (s * (s + 2));
  }
  for (int k = 1; k <= n; ++k) {
    const double s = 2 * k + a + b;
    // For k = 1 the general formula is 0/0 if a + b = −1. In its limit the factors k + a + b and s − 1 cancel.
    r.beta[k] = k == 1 ? 4 * (1 + a) * (1 + b) / (s * s * (s + 1))
                       : 4 * k * (k + a) * (k + b) * (k + a + b) / (s * s * (s + 1) * (s - 1));
  }
  return r;
}

/// p_n and its derivative at x, and the sum of the squares of p_0 … p_{n−1}, the reciprocal of the Gauss weight.
struct Evaluation {
  double value, derivative, squares;
};

Evaluation evaluate(const Recurrence& r, int n, double x) {
  double before = 0, value = 1 / std::sqrt(r.beta[0]), derivative_before = 0, derivative = 0, squares = 0;
  for (int k = 0; k < n; ++k) {
    squares += value * value;
    const double down = k == 0 ? 0.0 : std::sqrt(r.beta[k]);
    const double up = std::sqrt(r.beta[k + 1]);
    const double next = ((x - r.alpha[k]) * value - down * before) / up;
    const double derivative_next = (value + (x - r.alpha[k]) * derivative - down * derivative_before) / up;
    before = value;
    value = next;
    derivative_before = derivative;
    derivative = derivative_next;
  }
  return {value, derivative, squares};
}

}  // namespace

std::pair<Eigen::VectorXd, Eigen::VectorXd> gauss_jacobi(int n, double a, double b) {
  assert(n >= 1 && a > -1 && b > -1);
  const Recurrence r = recurrence(n, a, b);
  Eigen::VectorXd off(n - 1);
  for (int k = 1; k < n; ++k) off[k - 1] = std::sqrt(r.beta[k]);
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen;
  eigen.computeFromTridiagonal(r.alpha, off, Eigen::EigenvaluesOnly);
  Eigen::VectorXd points = eigen.eigenvalues(), weights(n);
  for (int i = 0; i < n; ++i) {
    for (int step = 0; step < 3; ++step) {
      const Evaluation at = evaluate(r, n, points[i]);
      points[i] -= at.value / at.derivative;
    }
  }
  // A symmetric weight has a symmetric rule, except for rounding errors. This removes them.
  if (a == b) {
    const Eigen::VectorXd mirrored = -points.reverse();
    points = 0.5 * (points + mirrored);
  }
  for (int i = 0; i < n; ++i) weights[i] = 1 / evaluate(r, n, points[i]).squares;
  return {points, weights};
}

}  // namespace varimesh::reference
