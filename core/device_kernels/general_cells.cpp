#include "core/device_kernels/general_cells.h"

namespace varimesh::device {

Possible<void> GeneralCells::copy(const Module& kernels, const Module& general) {
  const std::pair<const char*, Kernel*> wanted[] = {{"deform", &deform_},
                                                    {"scan", &scan_},
                                                    {"range", &range_},
                                                    {"stress", &stress_},
                                                    {"linearise", &linearise_},
                                                    {"gradient", &gradient_},
                                                    {"change_stress", &change_stress_},
                                                    {"product", &product_}};
  Possible<void> done = find_kernels(kernels, wanted);
  if (done) done = copy_cells(general);
  const std::size_t square = static_cast<std::size_t>(set_.dimension) * static_cast<std::size_t>(set_.dimension);
  if (!done) return done;
  auto fields = device_.allocate(lanes() * static_cast<std::size_t>(set_.points) * square * sizeof(double));
  if (!fields) return tl::unexpected(fields.error());
  fields_ = std::move(*fields);
  return {};
}

GeneralArguments GeneralCells::arguments(const SharedArrays& shared) const {
  GeneralArguments a = general_arguments(shared);
  a.fields = fields_.as<double>();
  a.changes = fields_.as<float>();
  return a;
}

Possible<void> GeneralCells::scan(const SharedArrays& shared) {
  GeneralArguments a = arguments(shared);
  Possible<void> done = run_general(deform_, set_.points, a);
  if (done) done = run_general(scan_, 1, a);
  return done;
}

Possible<void> GeneralCells::gradient(const SharedArrays& shared, bool keeps) {
  GeneralArguments a = arguments(shared);
  Possible<void> done = run_general(deform_, set_.points, a);
  if (done && keeps) done = run_general(range_, 1, a);
  if (done) done = run_general(keeps ? linearise_ : stress_, set_.points, a);
  if (done) done = run_general(gradient_, set_.nodes_per_cell, a);
  return done;
}

Possible<void> GeneralCells::product(const SharedArrays& shared) {
  GeneralArguments a = arguments(shared);
  a.contributions = contributions_of(shared, set_.dimension);
  Possible<void> done = run_general(change_stress_, set_.points, a);
  if (done) done = run_general(product_, set_.nodes_per_cell, a);
  return done;
}

}  // namespace varimesh::device
