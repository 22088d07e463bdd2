// Whether a device computes what the processor computes.
#pragma once

#include <span>
#include <vector>

#include "core/device/device.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::device {

/// Small bent meshes of all cells that have kernels of their own, and of some that have not. Each has vertices inside.
std::vector<HighOrderMesh> check_meshes();

/// Whether two lists have the same numbers, bit for bit. All NaNs are the same: which one an operation makes is up to
/// the device.
bool same_numbers(std::span<const double> one, std::span<const double> other);

/// The fault of a device that computes other numbers than the processor on cells of this mesh.
tl::unexpected<Fault> other_numbers(const Device& device, const HighOrderMesh& mesh);

/// Runs every kernel of the cells that this build has for a card on these meshes, and every kernel that judges cells,
/// on the device and on the processor, and compares the bits.
Possible<void> check_kernels(Device& device);

}  // namespace varimesh::device
