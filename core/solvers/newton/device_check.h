// Whether a device makes the processor's Newton steps.
#pragma once

#include "core/device/device.h"

namespace varimesh {

/// Makes a few steps of Newton's method on small meshes, on the device and on the processor in a device's place, and
/// compares the bits of the positions. Together with device::check_kernels() it runs every kernel of Newton's method on
/// the energy that this build has for a card.
device::Possible<void> check_newton(device::Device& device);

}  // namespace varimesh
