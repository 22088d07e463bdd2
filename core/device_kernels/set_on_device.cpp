#include "core/device_kernels/set_on_device.h"

#include <cmath>

#include "core/kernels/hessian/batches.h"

namespace varimesh::device {

Possible<void> SetOnDevice::find_kernels(const Module& kernels,
                                         std::span<const std::pair<const char*, Kernel*>> wanted) {
  const auto find = [&](const char* name, Kernel& kernel) -> Possible<void> {
    auto found = kernels.kernel(name);
    if (!found) return tl::unexpected(found.error());
    kernel = std::move(*found);
    return {};
  };
  Possible<void> done = find("keep_cell_gradients", keep_cell_gradients_);
  if (done) done = find("along_cell_gradients", along_cell_gradients_);
  if (done) done = find("add_norm_terms", add_norm_terms_);
  for (const auto& [name, kernel] : wanted)
    if (done) done = find(name, *kernel);
  return done;
}

Possible<void> SetOnDevice::copy_cells(const Module& general) {
  for (const auto& [name, kernel] : {std::pair<const char*, Kernel*>{"node_block", &node_block_},
                                     std::pair<const char*, Kernel*>{"mean_tensor", &mean_tensor_},
                                     std::pair<const char*, Kernel*>{"keep_convex_part", &keep_convex_part_}}) {
    auto found = general.kernel(name);
    if (!found) return tl::unexpected(found.error());
    *kernel = std::move(*found);
  }
  entries_ = make_hessian_kernels(material_, set_.dimension)->entries();
  std::vector<double> weights;
  for (const int point : slots_) weights.push_back(set_.weights[static_cast<std::size_t>(point)]);
  const auto node = [&](std::int32_t cell, int n) {
    return set_.nodes[static_cast<std::size_t>(cell) * static_cast<std::size_t>(set_.nodes_per_cell) +
                      static_cast<std::size_t>(n)];
  };
  std::vector<double> derivatives;
  for (const int point : slots_)
    for (int k = 0; k < set_.dimension; ++k)
      for (int n = 0; n < set_.nodes_per_cell; ++n)
        derivatives.push_back(set_.derivatives_of(n)[k * set_.stride + point]);
  Possible<void> done = keep(device_, weights_, weights);
  if (done) done = keep(device_, derivatives_, derivatives);
  if (done) done = keep(device_, nodes_, in_batches<std::int32_t>(set_.nodes_per_cell, node));
  if (done)
    done = keep(device_, ranks_, in_batches<std::int32_t>(set_.nodes_per_cell, [&](std::int32_t cell, int n) {
                  return rank_of_[static_cast<std::size_t>(node(cell, n))];
                }));
  if (done) done = copy_targets();
  const std::size_t square = static_cast<std::size_t>(set_.dimension) * static_cast<std::size_t>(set_.dimension);
  const std::size_t points = static_cast<std::size_t>(set_.points);
  const std::pair<Buffer*, std::size_t> sizes[] = {
      {&scans_, lanes() * 3 * sizeof(double)},
      {&linearisation_, lanes() * points * static_cast<std::size_t>(entries_) * sizeof(float)},
      {&deformation_, lanes() * points * square * sizeof(std::int16_t)},
      {&mean_, lanes() * (square + 1) * sizeof(float)}};
  for (const auto& [buffer, bytes] : sizes) {
    if (!done) return done;
    auto made = device_.allocate(bytes);
    if (!made) return tl::unexpected(made.error());
    *buffer = std::move(*made);
  }
  return done;
}

Possible<void> SetOnDevice::copy_targets() {
  const int square = set_.dimension * set_.dimension, per_cell = set_.affine ? 1 : set_.points;
  const auto slot = [&](int i) { return slots_[static_cast<std::size_t>(i)]; };
  Possible<void> done =
      keep(device_, inverse_target_, in_batches<double>(per_cell * square, [&](std::int32_t cell, int i) {
             const double* inverse = set_.inverse_target_of(cell);
             return set_.affine ? inverse[i] : inverse[i % square * set_.stride + slot(i / square)];
           }));
  if (done)
    done = keep(device_, measure_, in_batches<double>(per_cell, [&](std::int32_t cell, int i) {
                  const double* measure = set_.measure_of(cell);
                  return set_.affine ? *measure : measure[slot(i)] / set_.weights[static_cast<std::size_t>(slot(i))];
                }));
  if (done && !set_.left_factor.empty())
    done = keep(device_, left_factor_,
                in_batches<double>(square, [&](std::int32_t cell, int i) { return set_.left_factor_of(cell)[i]; }));
  return done;
}

Possible<void> SetOnDevice::weigh(std::span<const double> curvatures) {
  Possible<void> done = keep(device_, delta_squared_, in_batches<double>(1, [&](std::int32_t cell, int) {
                               return set_.delta_squared[static_cast<std::size_t>(cell)];
                             }));
  if (!done) return done;
  std::vector<double> slopes = in_batches<double>(1, [&](std::int32_t cell, int) {
    return set_.energy_slope.empty() ? 1.0 : set_.energy_slope[static_cast<std::size_t>(cell)];
  });
  std::fill(slopes.begin() + set_.count, slopes.end(), 0.0);
  done = keep(device_, slope_, slopes);
  if (!done || curvatures.empty()) return done;
  done = keep(device_, norm_factor_, in_batches<double>(1, [&](std::int32_t cell, int) {
                const double slope =
                    set_.energy_slope.empty() ? 1.0 : set_.energy_slope[static_cast<std::size_t>(cell)];
                // The contributions to the gradient are already multiplied by the slope.
                return slope > 0 ? std::sqrt(curvatures[static_cast<std::size_t>(cell)]) / slope : 0.0;
              }));
  const std::pair<Buffer*, std::size_t> sizes[] = {
      {&cell_gradients_, contributions() * static_cast<std::size_t>(set_.dimension) * sizeof(float)},
      {&along_, lanes() * sizeof(float)}};
  for (const auto& [buffer, bytes] : sizes) {
    if (!done || buffer->bytes() == bytes) continue;
    auto made = device_.allocate(bytes);
    if (!made) return tl::unexpected(made.error());
    *buffer = std::move(*made);
  }
  return done;
}

NormArguments SetOnDevice::norm_arguments(const SharedArrays& shared, int width) const {
  NormArguments a;
  a.batches = batches();
  a.nodes = set_.nodes_per_cell;
  a.factor = norm_factor_.as<const double>();
  a.gradients = cell_gradients_.as<float>();
  a.along = along_.as<float>();
  a.ranks = ranks_.as<const std::int32_t>();
  a.direction = shared.direction;
  a.contributions = contributions_of(shared, width);
  return a;
}

Possible<void> SetOnDevice::keep_cell_gradients(const SharedArrays& shared) {
  if (norm_factor_.bytes() == 0) return {};
  NormArguments a = norm_arguments(shared, 2 * set_.dimension);
  return device_.launch(keep_cell_gradients_, {static_cast<std::int64_t>(contributions()), kBlock, 0}, &a);
}

Possible<void> SetOnDevice::add_norm_term(const SharedArrays& shared) {
  if (norm_factor_.bytes() == 0) return {};
  NormArguments a = norm_arguments(shared, set_.dimension);
  Possible<void> done = device_.launch(along_cell_gradients_, {static_cast<std::int64_t>(lanes()), kBlock, 0}, &a);
  if (done) done = device_.launch(add_norm_terms_, {static_cast<std::int64_t>(contributions()), kBlock, 0}, &a);
  return done;
}

// ===== For the preconditioner =====

GeneralArguments SetOnDevice::general_arguments(const SharedArrays& shared) const {
  auto a = common_arguments<GeneralArguments>(shared);
  a.nodes = set_.nodes_per_cell;
  a.derivatives = derivatives_.as<const double>();
  a.ranks = ranks_.as<const std::int32_t>();
  a.direction = shared.direction;
  return a;
}

Possible<void> SetOnDevice::run_general(const Kernel& kernel, int per_batch, GeneralArguments& arguments) {
  return device_.launch(kernel, {static_cast<std::int64_t>(lanes()) * per_batch, kBlock, 0}, &arguments);
}

Possible<void> SetOnDevice::node_blocks(const SharedArrays& shared) {
  GeneralArguments a = general_arguments(shared);
  a.contributions = contributions_of(shared, triangle_size(set_.dimension));
  a.cell_gradients = norm_factor_.bytes() == 0 ? nullptr : cell_gradients_.as<const float>();
  return run_general(node_block_, set_.nodes_per_cell, a);
}

Possible<void> SetOnDevice::mean_tensors(const SharedArrays& shared) {
  const std::size_t bytes = lanes() * static_cast<std::size_t>(tensor_size(set_.dimension)) * sizeof(float);
  if (tensors_.bytes() != bytes) {
    auto made = device_.allocate(bytes);
    if (!made) return tl::unexpected(made.error());
    tensors_ = std::move(*made);
  }
  GeneralArguments a = general_arguments(shared);
  a.tensors = tensors_.as<float>();
  return run_general(mean_tensor_, 1, a);
}

Possible<void> SetOnDevice::keep_convex_part(const SharedArrays& shared) {
  GeneralArguments a = general_arguments(shared);
  return run_general(keep_convex_part_, set_.points, a);
}

Possible<void> SetOnDevice::download_scans(std::span<CellScan> scans) const {
  std::vector<double> numbers(lanes() * 3);
  if (auto done = scans_.download(std::span<double>(numbers)); !done) return done;
  for (std::size_t cell = 0; cell < scans.size(); ++cell) {
    const double* from = numbers.data() + cell / kBatch * 3 * kBatch + cell % kBatch;
    scans[cell] = {from[0], from[kBatch], from[2 * kBatch]};
  }
  return {};
}

std::size_t SetOnDevice::memory() const {
  std::size_t bytes = 0;
  for (const Buffer* buffer : {&weights_, &nodes_, &ranks_, &inverse_target_, &left_factor_, &measure_, &delta_squared_,
                               &slope_, &norm_factor_, &cell_gradients_, &along_, &derivatives_, &tensors_, &scans_,
                               &linearisation_, &deformation_, &mean_})
    bytes += buffer->bytes();
  return bytes;
}

}  // namespace varimesh::device
