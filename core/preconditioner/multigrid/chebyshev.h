// The smoother: a fixed polynomial in D⁻¹A.
#pragma once

#include <array>

#include "core/base/index.h"
#include "core/base/team.h"
#include "core/preconditioner/multigrid/level_matrix.h"

namespace varimesh::multigrid {

/// Degree of the polynomial, and the ratio of the ends of the interval on which it is small. The degree is even: the
/// polynomial p, p(0) = 1, is then between −1 and 1 not only on (0, largest] but up to largest · (1 + 1 / kRatio), so
/// that an estimate of the largest eigenvalue that is a seventh too low still gives a smoother that converges.
inline constexpr int kDegree = 2;
inline constexpr double kRatio = 6;
static_assert(kDegree % 2 == 0, "the iterates change places with the scratch vector");

/// How far one step of the smoother goes.
struct ChebyshevStep {
  double momentum;  ///< Times the step before.
  double step;      ///< Times D⁻¹ (b − A x).
};

/// The steps of the polynomial on [largest / kRatio, largest] (Saad, "Iterative methods for sparse linear systems",
/// algorithm 12.1).
inline std::array<ChebyshevStep, kDegree> chebyshev_steps(double largest) {
  const double center = 0.5 * (largest + largest / kRatio), half = 0.5 * (largest - largest / kRatio);
  const double sigma = center / half;
  std::array<ChebyshevStep, kDegree> steps{};
  double rho = 1 / sigma;
  steps[0] = {0, 1 / center};
  for (std::size_t k = 1; k < kDegree; ++k) {
    const double next_rho = 1 / (2 * sigma - rho);
    steps[k] = {next_rho * rho, 2 * next_rho / half};
    rho = next_rho;
  }
  return steps;
}

/// x becomes x + q(D⁻¹A) D⁻¹ (b − A x), in which 1 − λ q(λ) is the Chebyshev polynomial on [largest / kRatio, largest]
/// (Adams, Brezina, Hu and Tuminaro, "Parallel multigrid smoothing: polynomial versus Gauss–Seidel", J. Comput. Phys.
/// 188, 2003). The same before and after the coarser level, since D⁻¹A is symmetric in the inner product of A.
///
/// All vectors are rows × d, d innermost. With `from_zero`, x is taken to be 0 whatever it holds. `scratch` is written.
template <int d>
void smooth(const Team& team, const LevelMatrix& matrix, double largest, const double* b, double* x, double* scratch,
            bool from_zero) {
  const std::array<ChebyshevStep, kDegree> steps = chebyshev_steps(largest);
  const double* now = x;
  double* next = scratch;
  for (int k = 0; k < kDegree; ++k) {
    const bool is_zero = from_zero && k == 0;
    const bool was_zero = from_zero && k == 1;  // the iterate before
    const ChebyshevStep by = steps[at(k)];
    team.for_ranges(at(matrix.rows), kRowsPerTask, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        double sum[d] = {};
        if (!is_zero) row_off_diagonal<d>(matrix, i, now, sum);
        for (int c = 0; c < d; ++c) {
          const std::size_t at_c = i * d + at(c);
          const double own = is_zero ? 0 : now[at_c];
          const double before = k == 0 || was_zero ? 0 : next[at_c];
          const double move = k == 0 ? 0 : by.momentum * (own - before);
          next[at_c] = own + move + by.step * matrix.inverse[i] * (b[at_c] - matrix.diagonal[i] * own - sum[c]);
        }
      }
    });
    double* const written = next;
    next = const_cast<double*>(now);
    now = written;
  }
}

/// b − A x.
template <int d>
void residual(const Team& team, const LevelMatrix& matrix, const double* b, const double* x, double* residual) {
  team.for_ranges(at(matrix.rows), kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      double sum[d];
      row_off_diagonal<d>(matrix, i, x, sum);
      for (int c = 0; c < d; ++c)
        residual[i * d + at(c)] = b[i * d + at(c)] - matrix.diagonal[i] * x[i * d + at(c)] - sum[c];
    }
  });
}

}  // namespace varimesh::multigrid
