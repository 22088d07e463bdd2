// Whether a device computes what the processor computes.
#pragma once

#include "core/device/device.h"

namespace varimesh::device {

/// Runs every kernel that this build has for a card on a small mesh, on the device and on the processor, and compares
/// the bits.
Possible<void> check_kernels(Device& device);

}  // namespace varimesh::device
