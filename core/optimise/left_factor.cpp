#include "core/optimise/left_factor.h"

#include <array>

namespace varimesh {
namespace {

PatchCell without_left_factor(PatchCell cell) {
  cell.left_factor = nullptr;
  return cell;
}

// Where the entry of a symmetric matrix is in its lower triangle by rows.
std::size_t entry(int i, int j) { return std::size_t(i >= j ? i * (i + 1) / 2 + j : j * (j + 1) / 2 + i); }

}  // namespace

PatchExpansion expand_through_left_factors(const Kernels& kernels, int d, std::span<const PatchCell> patch) {
  PatchExpansion sum;
  for (const PatchCell& turned : patch) {
    const PatchCell cell = without_left_factor(turned);
    const PatchExpansion seen = kernels.expand({&cell, 1});
    sum.energy += seen.energy;
    sum.measure += seen.measure;
    std::array<double, 3> gradient{};
    times_left_factor(turned.left_factor, d, seen.gradient.data(), gradient.data());
    double half[3][3], full[3][3];  // rows: L times the columns of H, then L times the columns of that
    for (int j = 0; j < d; ++j) {
      double column[3];
      for (int i = 0; i < d; ++i) column[i] = seen.hessian[entry(i, j)];
      times_left_factor(turned.left_factor, d, column, half[j]);
    }
    for (int i = 0; i < d; ++i) {
      double column[3];
      for (int j = 0; j < d; ++j) column[j] = half[j][i];
      times_left_factor(turned.left_factor, d, column, full[i]);
    }
    for (int i = 0; i < d; ++i) {
      sum.gradient[i] += gradient[i];
      for (int j = 0; j <= i; ++j) sum.hessian[entry(i, j)] += full[i][j];
    }
  }
  return sum;
}

double energy_through_left_factors(const Kernels& kernels, int d, std::span<const PatchCell> patch,
                                   const double* step) {
  double sum = 0;
  for (const PatchCell& turned : patch) {
    const PatchCell cell = without_left_factor(turned);
    double seen[3];
    times_left_factor(turned.left_factor, d, step, seen);
    sum += kernels.energy_after({&cell, 1}, seen);
  }
  return sum;
}

}  // namespace varimesh
