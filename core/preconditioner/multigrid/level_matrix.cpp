#include "core/preconditioner/multigrid/level_matrix.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/random/hash.h"
#include "core/base/reduction.h"

namespace varimesh::multigrid {
namespace {

constexpr int kLanczosSteps = 12;
constexpr double kMargin = 1.1;
constexpr double kLeastNorm = 1e-10;  // of the first diagonal entry, for another step of Lanczos' method
constexpr std::size_t kRowsPerSum = 4096;

bool is_usable(double diagonal) { return diagonal > 0 && std::isfinite(diagonal) && std::isfinite(1 / diagonal); }

/// Zeros in the rows and columns that are left out.
void leave_out(const Team& team, LevelMatrix& matrix) {
  if (std::find(matrix.inverse.begin(), matrix.inverse.end(), 0.0) == matrix.inverse.end()) return;
  team.for_ranges(at(matrix.rows), kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i)
      for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1]; ++e)
        if (matrix.inverse[i] == 0 || matrix.inverse[at(matrix.column[at(e)])] == 0) matrix.value[at(e)] = 0;
  });
}

/// The largest Σ_j |a_ij| / a_ii.
double row_bound(const Team& team, const LevelMatrix& matrix) {
  return Reduction(team).largest(at(matrix.rows), kRowsPerSum, [&](std::size_t i) {
    double sum = matrix.diagonal[i];
    for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1]; ++e)
      sum += std::abs(static_cast<double>(matrix.value[at(e)]));
    return sum * matrix.inverse[i];
  });
}

/// The largest eigenvalue of the tridiagonal matrix that Lanczos' method ends with.
double largest_of(const std::vector<double>& diagonal, const std::vector<double>& beside) {
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  solver.computeFromTridiagonal(
      Eigen::Map<const Eigen::VectorXd>(diagonal.data(), static_cast<Eigen::Index>(diagonal.size())),
      Eigen::Map<const Eigen::VectorXd>(beside.data(), static_cast<Eigen::Index>(beside.size())),
      Eigen::EigenvaluesOnly);
  return solver.info() == Eigen::Success ? solver.eigenvalues().maxCoeff() : std::numeric_limits<double>::infinity();
}

}  // namespace

LevelMatrix level_matrix(const Team& team, const CompressedRows& from) {
  LevelMatrix out;
  out.rows = from.rows;
  const std::size_t rows = at(from.rows);
  out.begin.assign(rows + 1, 0);
  for (std::size_t i = 0; i < rows; ++i) {
    const std::int32_t *first = from.column + from.row_begin[i], *last = from.column + from.row_begin[i + 1];
    out.begin[i + 1] = out.begin[i] + (last - first) - std::count(first, last, static_cast<std::int32_t>(i));
  }
  out.column.resize(at(out.begin[rows]));
  out.value.resize(at(out.begin[rows]));
  out.diagonal.resize(rows);
  out.inverse.resize(rows);
  team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      double sum = 0;
      bool is_positive = false;
      std::size_t to = at(out.begin[i]);
      for (std::int64_t e = from.row_begin[i]; e < from.row_begin[i + 1]; ++e) {
        const double value = from.value[e];
        sum += value;
        if (from.column[e] == static_cast<std::int32_t>(i)) {
          is_positive = is_usable(value);
          continue;
        }
        out.column[to] = from.column[e];
        out.value[to++] = static_cast<float>(value);
      }
      for (std::size_t e = at(out.begin[i]); e < to; ++e) sum -= static_cast<double>(out.value[e]);
      out.diagonal[i] = is_positive && is_usable(sum) ? sum : 0;
      out.inverse[i] = out.diagonal[i] > 0 ? 1 / out.diagonal[i] : 0;
    }
  });
  leave_out(team, out);
  return out;
}

LevelMatrix level_matrix(const Team& team, FloatRows&& off_diagonal, std::span<const double> row_sums) {
  team.for_ranges(at(off_diagonal.rows), kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      const auto row = static_cast<std::int32_t>(i);
      for (std::int64_t e = off_diagonal.begin[i]; e < off_diagonal.begin[i + 1] && off_diagonal.column[at(e)] < row;
           ++e) {
        const std::size_t other = at(off_diagonal.column[at(e)]);
        const auto end = off_diagonal.column.begin() + off_diagonal.begin[other + 1];
        const auto found = std::lower_bound(off_diagonal.column.begin() + off_diagonal.begin[other], end, row);
        off_diagonal.value[at(e)] =
            found != end && *found == row ? off_diagonal.value[at(found - off_diagonal.column.begin())] : 0;
      }
    }
  });
  LevelMatrix out;
  out.rows = off_diagonal.rows;
  const std::size_t rows = at(off_diagonal.rows);
  out.begin = std::move(off_diagonal.begin);
  out.column = std::move(off_diagonal.column);
  out.value = std::move(off_diagonal.value);
  out.diagonal.resize(rows);
  out.inverse.resize(rows);
  team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      double sum = row_sums[i];
      for (std::int64_t e = out.begin[i]; e < out.begin[i + 1]; ++e) sum -= static_cast<double>(out.value[at(e)]);
      out.diagonal[i] = is_usable(sum) ? sum : 0;
      out.inverse[i] = out.diagonal[i] > 0 ? 1 / out.diagonal[i] : 0;
    }
  });
  leave_out(team, out);
  return out;
}

void multiply(const Team& team, const LevelMatrix& matrix, const std::vector<double>& x, std::vector<double>& product) {
  product.resize(x.size());
  team.for_ranges(x.size(), kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      double sum[1];
      row_off_diagonal<1>(matrix, i, x.data(), sum);
      product[i] = matrix.diagonal[i] * x[i] + sum[0];
    }
  });
}

double largest_eigenvalue(const Team& team, const LevelMatrix& matrix) {
  // Lanczos' recurrence for D⁻¹A in the inner product xᵀDy, in which it is symmetric.
  const std::size_t rows = at(matrix.rows);
  std::vector<double> v(rows), before(rows), product;
  for (std::size_t i = 0; i < rows; ++i)
    v[i] = matrix.inverse[i] > 0 ? hash(static_cast<std::uint32_t>(i)) / 4294967296.0 - 0.5 : 0;
  std::vector<double> diagonal, beside;
  const Reduction reduction(team);
  const auto norm_of_v = [&] {
    return std::sqrt(reduction.sum(rows, kRowsPerSum, [&](std::size_t i) { return matrix.diagonal[i] * v[i] * v[i]; }));
  };
  double norm = norm_of_v();
  while (norm > (diagonal.empty() ? 0 : kLeastNorm * diagonal[0])) {
    const double beta = diagonal.empty() ? 0 : norm;
    if (!diagonal.empty()) beside.push_back(beta);
    team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) v[i] /= norm;
    });
    multiply(team, matrix, v, product);
    const double alpha = reduction.sum(rows, kRowsPerSum, [&](std::size_t i) { return v[i] * product[i]; });
    diagonal.push_back(alpha);
    if (static_cast<int>(diagonal.size()) == kLanczosSteps) break;
    team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        const double next = matrix.inverse[i] * product[i] - alpha * v[i] - beta * before[i];
        before[i] = v[i];
        v[i] = next;
      }
    });
    norm = norm_of_v();
  }
  return diagonal.empty() ? 1 : std::min(kMargin * largest_of(diagonal, beside), row_bound(team, matrix));
}

}  // namespace varimesh::multigrid
