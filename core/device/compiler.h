// The compiler of kernels, which is a library of its own beside NVIDIA's driver.
#pragma once

#include "core/device/device.h"

namespace varimesh::device {

/// Makes the driver load its compiler, by giving it a kernel that does nothing. It is for a process that may load no
/// libraries later. A device that compiles nothing, or that does not accept the kernel, loads nothing.
void load_compiler(Device& device);

}  // namespace varimesh::device
