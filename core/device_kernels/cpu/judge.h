// The kernels that judge cells (kernels/judge/kernels.h), for the processor. No energy is in them.
#pragma once

#include <span>

#include "core/device/device.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_judge_2d();
std::span<const CpuKernel> cpu_judge_3d();

}  // namespace varimesh::device
