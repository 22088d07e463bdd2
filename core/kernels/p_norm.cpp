#include "core/kernels/p_norm.h"

namespace varimesh {
namespace {

double measure_of(const StarCell& cell) {
  double sum = 0;
  for (int q = 0; q < cell.stride; ++q) sum += cell.affine ? cell.weights[q] * cell.measure[0] : cell.measure[q];
  return sum;
}

}  // namespace

double cell_measure(const CellSet& set, std::int32_t cell) {
  const double* volume = set.measure_of(cell);
  double sum = 0;
  for (int q = 0; q < set.points; ++q) sum += set.affine ? set.weights[q] * volume[0] : volume[q];
  return sum;
}

StarExpansion expand(const Kernels& kernels, std::span<const StarCell> star, const PNorm& norm) {
  if (norm.is_sum()) return kernels.expand(star);
  StarExpansion sum;
  for (std::size_t c = 0; c < star.size(); ++c) {
    const StarExpansion cell = kernels.expand(star.subspan(c, 1));
    const double slope = norm.slope(cell.energy, cell.measure), curvature = norm.curvature(cell.energy, cell.measure);
    sum.energy += norm.value(cell.energy, cell.measure);
    sum.measure += slope * cell.measure;
    for (int i = 0, entry = 0; i < 3; ++i) {
      sum.gradient[i] += slope * cell.gradient[i];
      for (int j = 0; j <= i; ++j, ++entry)
        sum.hessian[entry] += slope * cell.hessian[entry] + curvature * cell.gradient[i] * cell.gradient[j];
    }
  }
  return sum;
}

double energy_after(const Kernels& kernels, std::span<const StarCell> star, const double* step, const PNorm& norm) {
  if (norm.is_sum()) return kernels.energy_after(star, step);
  double sum = 0;
  for (std::size_t c = 0; c < star.size(); ++c)
    sum += norm.value(kernels.energy_after(star.subspan(c, 1), step), measure_of(star[c]));
  return sum;
}

}  // namespace varimesh
