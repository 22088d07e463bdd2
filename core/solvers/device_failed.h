// What an objective on a device throws.
#pragma once

#include "core/device/fault.h"

namespace varimesh {

/// What a function of an objective on a device throws if the device has a fault. The problem's nodes are where
/// linearise() found them, or where the last settle() has put them.
struct DeviceFailed {
  device::Fault fault;
};

}  // namespace varimesh
