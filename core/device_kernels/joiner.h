// Sums and largest values of numbers that are on a device.
#pragma once

#include <cstdint>

#include "core/device/queue.h"

namespace varimesh::device {

/// Joins the parts that the blocks of a kernel have left, in trees that depend on their number only.
class Joiner {
 public:
  /// @param solver  the module of solver_kernels()
  Joiner(Queue& queue, const Module* solver);

  /// Room for the parts that a kernel leaves if it runs with this number of threads.
  double* parts(std::int64_t threads);
  /// The sum of these parts, and the largest of them. 0 after a fault of the device.
  double sum(std::int64_t threads);
  double largest(std::int64_t threads);

  std::size_t memory() const { return parts_.bytes() + fewer_.bytes() + fewest_.bytes(); }

 private:
  /// Runs the kernel until few parts are left, and returns these.
  std::vector<double> join(const Kernel& kernel, std::int64_t threads);

  Queue& queue_;
  Kernel add_, largest_;
  Buffer parts_, fewer_, fewest_;
};

/// Shared memory of a kernel that leaves parts.
inline constexpr int kJoinBytes = kBlock * static_cast<int>(sizeof(double));

}  // namespace varimesh::device
