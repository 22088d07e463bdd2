// The kernels for the processor, for the energy of a material: those of tetrahedra, and those of all other cells. They
// are compiled in several files, to share the work.
#pragma once

#include <span>

#include "core/device/device.h"
#include "core/energy/material.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_tetrahedra_2(const Material& material);
std::span<const CpuKernel> cpu_tetrahedra_3(const Material& material);
std::span<const CpuKernel> cpu_tetrahedra_4(const Material& material);
std::span<const CpuKernel> cpu_tetrahedra_5(const Material& material);

std::span<const CpuKernel> cpu_general_2d(const Material& material);
std::span<const CpuKernel> cpu_general_3d(const Material& material);

/// Those of Newton's method besides the kernels of the cells. No energy is in them.
std::span<const CpuKernel> cpu_solver_2d();
std::span<const CpuKernel> cpu_solver_3d();

}  // namespace varimesh::device
