// The maps of one order on the cells of a mesh, on a device.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/device/queue.h"
#include "core/device_kernels/kernels/descent/arguments.h"
#include "core/problem/problem.h"
#include "core/solvers/descent/form/order_space.h"

namespace varimesh {

/// An OrderSpace on a device. The contributions of cells to sums over the cells of a node are set by set, batches ×
/// place × lane × d, with room for lanes past the last cell.
struct SpaceOnDevice {
  struct Set {
    std::int32_t batches = 0;
    std::int32_t places = 0;  ///< Nodes of a cell.
    std::int64_t first = 0;   ///< Contributions of the sets before, in units of d numbers.
    device::Buffer numbers;   ///< As GatherArguments.
  };
  std::int32_t count = 0;  ///< Free nodes.
  std::vector<Set> sets;
  device::Buffer begin, places;  ///< As OrderArguments.

  /// The arguments of kernels that work on the free nodes.
  device::OrderArguments arguments(const double* contributions) const;
  std::size_t memory() const;
};

/// By set of the problem and node of a cell: its place, as LaneMatrix::column_places. Empty for a set whose nodes are
/// in their own order.
using PlacesOfNodes = std::vector<std::span<const std::size_t>>;

/// Copies a space of the problem.
SpaceOnDevice copy_space(device::Queue& queue, const Problem& problem, const OrderSpace& space,
                         const PlacesOfNodes& places, const Team& team);

}  // namespace varimesh
