// Whether a device makes the processor's steps of the descent.
#pragma once

#include "core/device/device.h"

namespace varimesh {

/// Makes steps of the descent on small meshes, on the device and on the processor in a device's place, and compares the
/// bits of the positions and of what the objective returns. It runs every kernel of device::descent_kernels(), and
/// those of the cells' convex part.
device::Possible<void> check_descent(device::Device& device);

}  // namespace varimesh
