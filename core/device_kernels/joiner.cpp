#include "core/device_kernels/joiner.h"

#include <algorithm>

#include "core/device_kernels/kernels/solver_arguments.h"

namespace varimesh::device {
namespace {

static_assert(kBlock == kJoinedThreads);
constexpr std::int64_t kPartsPerBlock = std::int64_t{kBlock} * kPartsPerThread;

std::int64_t groups(std::int64_t count, std::int64_t size) { return (count + size - 1) / size; }
std::size_t bytes(std::int64_t numbers) { return static_cast<std::size_t>(numbers) * sizeof(double); }

}  // namespace

Joiner::Joiner(Queue& queue, const Module* solver)
    : queue_(queue), add_(queue.kernel(solver, "add_parts")), largest_(queue.kernel(solver, "largest_part")) {}

double* Joiner::parts(std::int64_t threads) {
  const std::int64_t count = groups(threads, kBlock);
  if (parts_.bytes() < bytes(count)) {
    parts_ = queue_.room(bytes(count));
    fewer_ = queue_.room(bytes(groups(count, kPartsPerBlock)));
    fewest_ = queue_.room(bytes(groups(groups(count, kPartsPerBlock), kPartsPerBlock)));
  }
  return parts_.as<double>();
}

std::vector<double> Joiner::join(const Kernel& kernel, std::int64_t threads) {
  std::int64_t count = groups(threads, kBlock);
  const Buffer *from = &parts_, *to = &fewer_;
  while (count > kPartsPerBlock) {
    PartsArguments a{count, from->as<const double>(), to->as<double>()};
    count = groups(count, kPartsPerBlock);
    queue_.launch(kernel, count * kBlock, a, kJoinBytes);
    from = to;
    to = to == &fewer_ ? &fewest_ : &fewer_;
  }
  std::vector<double> parts(static_cast<std::size_t>(count));
  queue_.download(*from, std::span<double>(parts));
  return queue_.is_well() ? parts : std::vector<double>();
}

double Joiner::sum(std::int64_t threads) {
  double sum = 0;
  for (const double part : join(add_, threads)) sum += part;
  return sum;
}

double Joiner::largest(std::int64_t threads) {
  double largest = 0;
  for (const double part : join(largest_, threads)) largest = std::max(largest, part);
  return largest;
}

}  // namespace varimesh::device
