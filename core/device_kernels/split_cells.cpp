#include "core/device_kernels/split_cells.h"

namespace varimesh::device {

Possible<void> SplitCells::copy(const Module& kernels, const Module& general) {
  const std::pair<const char*, Kernel*> wanted[] = {
      {"energy", &energy_}, {"gradient", &gradient_}, {"linearise", &linearise_}, {"product", &product_}};
  const auto parts = [&](CellKernel kernel) { return parts_of(kernel, tables_.kind); };
  Possible<void> done = find_kernels(kernels, wanted);
  if (done) done = copy_cells(general);
  if (done) done = keep(device_, energy_table_, tables_.derivatives<double>(parts(CellKernel::Energy)));
  if (done) done = keep(device_, gradient_table_, tables_.derivatives<double>(parts(CellKernel::Gradient)));
  if (done) done = keep(device_, product_table_, tables_.derivatives<float>(parts(CellKernel::Product)));
  if (!done || !tables_.kind.is_layered()) return done;
  done = keep(device_, nodes_by_column_, tables_.nodes);
  if (done) done = keep(device_, slots_by_point_, tables_.slots);
  return done;
}

template <class T>
CellTables<T> SplitCells::tables(const Buffer& derivatives) const {
  return {tables_.bases, tables_.heights, derivatives.as<const T>(), nodes_by_column_.as<const std::int32_t>(),
          slots_by_point_.as<const std::int32_t>()};
}

CellArguments SplitCells::arguments(const SharedArrays& shared, const Buffer& derivatives) const {
  auto a = common_arguments<CellArguments>(shared);
  a.tables = tables<double>(derivatives);
  return a;
}

Launch SplitCells::launch_with(CellKernel kernel, const Buffer& derivatives) const {
  return {static_cast<std::int64_t>(lanes()) * parts_of(kernel, tables_.kind), kBlock,
          static_cast<int>(derivatives.bytes())};
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
  a.affine = set_.affine;
  a.tables = tables<float>(product_table_);
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
  return SetOnDevice::memory() + energy_table_.bytes() + gradient_table_.bytes() + product_table_.bytes() +
         nodes_by_column_.bytes() + slots_by_point_.bytes();
}

}  // namespace varimesh::device
