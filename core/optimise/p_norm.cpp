#include "core/optimise/p_norm.h"

namespace varimesh {
namespace {

double measure_of(const PatchCell& cell) {
  double sum = 0;
  for (int q = 0; q < cell.stride; ++q) sum += cell.affine ? cell.weights[q] * cell.measure[0] : cell.measure[q];
  return sum;
}

}  // namespace

double cell_measure(const CellBlock& block, std::int32_t cell) {
  const double* volume = block.measure_of(cell);
  double sum = 0;
  for (int q = 0; q < block.points; ++q) sum += block.affine ? block.weights[q] * volume[0] : volume[q];
  return sum;
}

PatchExpansion expand(const Kernels& kernels, std::span<const PatchCell> patch, const PNorm& norm) {
  if (norm.is_sum()) return kernels.expand(patch);
  PatchExpansion sum;
  for (std::size_t c = 0; c < patch.size(); ++c) {
    const PatchExpansion cell = kernels.expand(patch.subspan(c, 1));
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

double energy_after(const Kernels& kernels, std::span<const PatchCell> patch, const double* step, const PNorm& norm) {
  if (norm.is_sum()) return kernels.energy_after(patch, step);
  double sum = 0;
  for (std::size_t c = 0; c < patch.size(); ++c)
    sum += norm.value(kernels.energy_after(patch.subspan(c, 1), step), measure_of(patch[c]));
  return sum;
}

}  // namespace varimesh
