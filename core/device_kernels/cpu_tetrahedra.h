// The kernels of tetrahedra for the processor. They are compiled for one order a file, to share the work.
#pragma once

#include <span>

#include "core/device/device.h"
#include "core/energy/material.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_tetrahedra_2(const Material& material);
std::span<const CpuKernel> cpu_tetrahedra_3(const Material& material);
std::span<const CpuKernel> cpu_tetrahedra_4(const Material& material);
std::span<const CpuKernel> cpu_tetrahedra_5(const Material& material);

}  // namespace varimesh::device
