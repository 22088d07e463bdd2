#include "core/device_kernels/set_on_device.h"

#include "core/kernels/hessian/batches.h"

namespace varimesh::device {

Possible<void> SetOnDevice::copy_cells() {
  slots_ = fold_gradient(set_).points;
  entries_ = make_hessian_kernels(material_, set_.dimension)->entries();
  std::vector<double> weights;
  for (const int point : slots_) weights.push_back(set_.weights[static_cast<std::size_t>(point)]);
  weights.resize(weights.size() + 4);  // as many as a turn may add
  const auto node = [&](std::int32_t cell, int n) {
    return set_.nodes[static_cast<std::size_t>(cell) * static_cast<std::size_t>(set_.nodes_per_cell) +
                      static_cast<std::size_t>(n)];
  };
  Possible<void> done = keep(device_, weights_, weights);
  if (done) done = keep(device_, nodes_, in_batches<std::int32_t>(set_.nodes_per_cell, node));
  if (done)
    done = keep(device_, ranks_, in_batches<std::int32_t>(set_.nodes_per_cell, [&](std::int32_t cell, int n) {
                  return rank_of_[static_cast<std::size_t>(node(cell, n))];
                }));
  if (done && !set_.left_factor.empty())
    done = keep(device_, left_factor_,
                in_batches<double>(set_.dimension * set_.dimension,
                                   [&](std::int32_t cell, int i) { return set_.left_factor_of(cell)[i]; }));
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

Possible<void> SetOnDevice::weigh() {
  const Possible<void> done = keep(device_, delta_squared_, in_batches<double>(1, [&](std::int32_t cell, int) {
                                     return set_.delta_squared[static_cast<std::size_t>(cell)];
                                   }));
  if (!done) return done;
  std::vector<double> slopes = in_batches<double>(1, [&](std::int32_t cell, int) {
    return set_.energy_slope.empty() ? 1.0 : set_.energy_slope[static_cast<std::size_t>(cell)];
  });
  std::fill(slopes.begin() + set_.count, slopes.end(), 0.0);
  return keep(device_, slope_, slopes);
}

Possible<void> SetOnDevice::download_scans(std::span<CellScan> scans) const {
  std::vector<double> numbers(lanes() * 3);
  if (const auto done = scans_.download(std::span<double>(numbers)); !done) return done;
  for (std::size_t cell = 0; cell < scans.size(); ++cell) {
    const double* from = numbers.data() + cell / kBatch * 3 * kBatch + cell % kBatch;
    scans[cell] = {from[0], from[kBatch], from[2 * kBatch]};
  }
  return {};
}

std::size_t SetOnDevice::memory() const {
  std::size_t bytes = 0;
  for (const Buffer* buffer : {&weights_, &nodes_, &ranks_, &inverse_target_, &left_factor_, &measure_, &delta_squared_,
                               &slope_, &scans_, &linearisation_, &deformation_, &mean_})
    bytes += buffer->bytes();
  return bytes;
}

}  // namespace varimesh::device
