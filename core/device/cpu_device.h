// The processor as a device: memory is ordinary memory, and a launch runs the kernel's threads one after another.
#pragma once

#include <memory>

#include "core/device/device.h"

namespace varimesh::device {

std::unique_ptr<Device> make_cpu_device();

}  // namespace varimesh::device
