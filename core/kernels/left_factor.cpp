#include "core/kernels/left_factor.h"

#include <array>

#include "core/base/index.h"

namespace varimesh {
namespace {

StarCell without_left_factor(StarCell cell) {
  cell.left_factor = nullptr;
  return cell;
}

}  // namespace

StarExpansion expand_through_left_factors(const Kernels& kernels, int d, std::span<const StarCell> star) {
  StarExpansion sum;
  for (const StarCell& turned : star) {
    const StarCell cell = without_left_factor(turned);
    const StarExpansion plain = kernels.expand({&cell, 1});
    sum.energy += plain.energy;
    sum.measure += plain.measure;
    std::array<double, 3> gradient{};
    times_left_factor(turned.left_factor, d, plain.gradient.data(), gradient.data());
    double half[3][3], full[3][3];  // rows: L times the columns of H, then L times the columns of `half`
    for (int j = 0; j < d; ++j) {
      double column[3];
      for (int i = 0; i < d; ++i) column[i] = plain.hessian[symmetric_index(i, j)];
      times_left_factor(turned.left_factor, d, column, half[j]);
    }
    for (int i = 0; i < d; ++i) {
      double column[3];
      for (int j = 0; j < d; ++j) column[j] = half[j][i];
      times_left_factor(turned.left_factor, d, column, full[i]);
    }
    for (int i = 0; i < d; ++i) {
      sum.gradient[i] += gradient[i];
      for (int j = 0; j <= i; ++j) sum.hessian[symmetric_index(i, j)] += full[i][j];
    }
  }
  return sum;
}

double energy_through_left_factors(const Kernels& kernels, int d, std::span<const StarCell> star, const double* step) {
  double sum = 0;
  for (const StarCell& turned : star) {
    const StarCell cell = without_left_factor(turned);
    double turned_step[3];
    times_left_factor(turned.left_factor, d, step, turned_step);
    sum += kernels.energy_after({&cell, 1}, turned_step);
  }
  return sum;
}

}  // namespace varimesh
