#include "core/solvers/on_device/minimised_on_device.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/index.h"

namespace varimesh {

template <class Arguments>
MinimisedOnDevice<Arguments>::MinimisedOnDevice(device::Device& device, Problem& problem,
                                                const device::KernelImage& image, const Material& material,
                                                const Team& team)
    : queue_(device),
      problem_(problem),
      team_(team),
      nodes_(std::ssize(problem.free)),
      unknowns_(nodes_ * problem.dimension),
      module_(queue_.load(image)) {
  check();
  auto cells = device::CellsOnDevice::make(device, problem, material);
  if (!cells) throw DeviceFailed{cells.error()};
  cells_ = std::move(*cells);
  joiner_.emplace(queue_, module_.get());
  step_ = queue_.room(at(unknowns_) * sizeof(double));
  queue_.fill(free_, problem.free);
  queue_.fill(inverse_size_, problem.inverse_size);
  find({{"advance", &vectors_.advance},
        {"turn", &vectors_.turn},
        {"take_direction", &vectors_.take_direction},
        {"keep_residual", &vectors_.keep_residual},
        {"square_of_gradient", &vectors_.square_of_gradient},
        {"along_step", &vectors_.along_step},
        {"size_of_step", &vectors_.size_of_step},
        {"size_of_product", &vectors_.size_of_product},
        {"keep_start", &vectors_.keep_start},
        {"place", &vectors_.place}});
  check();
}

template <class Arguments>
void MinimisedOnDevice<Arguments>::find(std::initializer_list<std::pair<const char*, device::Kernel*>> kernels) {
  for (const auto& [name, kernel] : kernels) *kernel = queue_.kernel(module_.get(), name);
}

template <class Arguments>
void MinimisedOnDevice<Arguments>::check() const {
  if (queue_.fault()) throw DeviceFailed{*queue_.fault()};
}

template <class Arguments>
Arguments MinimisedOnDevice<Arguments>::common(std::int64_t count) const {
  Arguments a;
  a.count = count;
  a.step = step_.as<double>();
  a.gradient = cells_->gradient_there().template as<double>();
  a.positions = cells_->positions_there().template as<double>();
  a.free = free_.as<const std::int32_t>();
  a.inverse_size = inverse_size_.as<const float>();
  return a;
}

template <class Arguments>
void MinimisedOnDevice<Arguments>::run(const device::Kernel& kernel, double factor) {
  Arguments a = arguments(unknowns_);
  a.factor = factor;
  queue_.launch(kernel, a.count, a);
}

template <class Arguments>
void MinimisedOnDevice<Arguments>::run_on_nodes(const device::Kernel& kernel, double factor) {
  Arguments a = arguments(nodes_);
  a.factor = factor;
  queue_.launch(kernel, a.count, a);
}

template <class Arguments>
double MinimisedOnDevice<Arguments>::sum(const device::Kernel& kernel, std::int64_t count, double factor) {
  Arguments a = arguments(count);
  a.factor = factor;
  a.parts = joiner_->parts(count);
  queue_.launch(kernel, count, a, device::kJoinBytes);
  const double sum = joiner_->sum(count);
  check();
  return sum;
}

template <class Arguments>
double MinimisedOnDevice<Arguments>::largest(const device::Kernel& kernel, std::int64_t count) {
  Arguments a = arguments(count);
  a.parts = joiner_->parts(count);
  queue_.launch(kernel, count, a, device::kJoinBytes);
  const double largest = joiner_->largest(count);
  check();
  return largest;
}

template <class Arguments>
double MinimisedOnDevice<Arguments>::largest_of_nodes(const device::Kernel& kernel) {
  return std::sqrt(largest(kernel, nodes_));
}

template <class Arguments>
double MinimisedOnDevice<Arguments>::gradient_norm() {
  return std::sqrt(sum(vectors_.square_of_gradient, unknowns_));
}

template <class Arguments>
void MinimisedOnDevice<Arguments>::scan(CellEnergy& energy) {
  const auto scans = cells_->scan();
  if (!scans) throw DeviceFailed{scans.error()};
  std::ranges::copy(*scans, energy.scans_to_fill().begin());
}

template <class Arguments>
void MinimisedOnDevice<Arguments>::settle() {
  std::vector<double> positions(problem_.positions.size());
  queue_.download(cells_->positions_there(), std::span<double>(positions));
  check();
  problem_.positions = std::move(positions);
}

template <class Arguments>
std::size_t MinimisedOnDevice<Arguments>::memory_in_common() const {
  return cells_->memory() + joiner_->memory() + step_.bytes() + free_.bytes() + inverse_size_.bytes();
}

template class MinimisedOnDevice<device::VectorArguments>;
template class MinimisedOnDevice<device::LossArguments>;

}  // namespace varimesh
