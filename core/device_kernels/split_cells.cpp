#include "core/device_kernels/split_cells.h"

#include <algorithm>

namespace varimesh::device {
namespace {

/// A table of derivatives as CellArguments and ProductArguments describe it. `slots`: the quadrature point of each
/// slot.
///
/// @param repeats  whether the padding repeats the last point, and the mean is appended; else the padding is 0
template <class T>
std::vector<T> table_of(const CellSet& set, const std::vector<int>& slots, int parts, bool repeats) {
  const int per_part = (set.nodes_per_cell + parts - 1) / parts;
  const int padded = padded_points(set.points, parts);
  const auto number = [&](int row, int n, int k) {
    if (n >= set.nodes_per_cell) return 0.0;
    const double* derivatives = set.derivatives_of(n) + k * set.stride;
    if (row < set.points || (row < padded && repeats))
      return derivatives[slots[static_cast<std::size_t>(std::min(row, set.points - 1))]];
    double sum = 0;
    for (int q = 0; q < set.points && row == padded; ++q) sum += derivatives[q] / set.points;
    return sum;
  };
  std::vector<T> table;
  for (int row = 0; row < padded + (repeats ? 1 : 0); ++row)
    for (int part = 0; part < parts; ++part)
      for (int k = 0; k < set.dimension; ++k)
        for (int n = part * per_part; n < (part + 1) * per_part; ++n)
          table.push_back(static_cast<T>(number(row, n, k)));
  return table;
}

}  // namespace

Possible<void> SplitCells::copy(const Module& kernels, const Module& general) {
  const std::pair<const char*, Kernel*> wanted[] = {
      {"energy", &energy_}, {"gradient", &gradient_}, {"linearise", &linearise_}, {"product", &product_}};
  const auto parts = [&](CellKernel kernel) { return parts_of(kernel, set_.nodes_per_cell); };
  Possible<void> done = find_kernels(kernels, wanted);
  if (done) done = copy_cells(general);
  if (done)
    done = keep(device_, inverse_target_,
                in_batches<double>(set_.dimension * set_.dimension,
                                   [&](std::int32_t cell, int i) { return set_.inverse_target_of(cell)[i]; }));
  if (done)
    done =
        keep(device_, measure_, in_batches<double>(1, [&](std::int32_t cell, int) { return *set_.measure_of(cell); }));
  if (done) done = keep(device_, energy_table_, table_of<double>(set_, slots_, parts(CellKernel::Energy), true));
  if (done) done = keep(device_, gradient_table_, table_of<double>(set_, slots_, parts(CellKernel::Gradient), true));
  if (done) done = keep(device_, product_table_, table_of<float>(set_, slots_, parts(CellKernel::Product), false));
  return done;
}

CellArguments SplitCells::arguments(const SharedArrays& shared, const Buffer& table) const {
  auto a = common_arguments<CellArguments>(shared);
  a.nodes = nodes_.as<const std::int32_t>();
  a.derivatives = table.as<const double>();
  return a;
}

Launch SplitCells::launch_with(CellKernel kernel, const Buffer& table) const {
  return {static_cast<std::int64_t>(lanes()) * parts_of(kernel, set_.nodes_per_cell), kBlock,
          static_cast<int>(table.bytes())};
}

Possible<void> SplitCells::scan(const SharedArrays& shared) {
  CellArguments a = arguments(shared, energy_table_);
  return device_.launch(energy_, launch_with(CellKernel::Energy, energy_table_), &a);
}

Possible<void> SplitCells::gradient(const SharedArrays& shared, bool keeps) {
  CellArguments a = arguments(shared, gradient_table_);
  return device_.launch(keeps ? linearise_ : gradient_, launch_with(CellKernel::Gradient, gradient_table_), &a);
}

Possible<void> SplitCells::product(const SharedArrays& shared) {
  ProductArguments a;
  a.material = material_;
  a.batches = batches();
  a.points = set_.points;
  a.derivatives = product_table_.as<const float>();
  a.inverse_target = inverse_target_.as<const double>();
  a.left_factor = left_factor_.as<const double>();
  a.linearisation = linearisation_.as<const float>();
  a.deformation = deformation_.as<const std::int16_t>();
  a.mean = mean_.as<const float>();
  a.ranks = ranks_.as<const std::int32_t>();
  a.direction = shared.direction;
  a.contributions = contributions_of(shared, set_.dimension);
  return device_.launch(product_, launch_with(CellKernel::Product, product_table_), &a);
}

std::size_t SplitCells::memory() const {
  return SetOnDevice::memory() + energy_table_.bytes() + gradient_table_.bytes() + product_table_.bytes();
}

}  // namespace varimesh::device
