// Whether a device judges cells as the processor in a device's place does.
#pragma once

#include "core/device/device.h"

namespace varimesh {

/// Runs every kernel that judges cells on the meshes of device::check_meshes(), on the device and on the processor, and
/// compares the bits.
device::Possible<void> check_judgement(device::Device& device);

}  // namespace varimesh
