// The kernels for the processor: those that keep cells of one kind in registers, of the hyperelastic energy, and those
// of all other cells, of the energy of a material. They are compiled in several files, to share the work.
#pragma once

#include <span>

#include "core/device/device.h"
#include "core/energy/material.h"

namespace varimesh::device {

#define KIND(shape, name, order, dimension, columns, layers) std::span<const CpuKernel> cpu_##name##_##order();
#include "core/device_kernels/kernels/cell_kinds.h"

std::span<const CpuKernel> cpu_general_2d(const Material& material);
std::span<const CpuKernel> cpu_general_3d(const Material& material);
/// The number of a material's energy in kernels/energies.h.
int energy_number(int dimension, const Material& material);

/// Those of Newton's method besides the kernels of the cells. No energy is in them.
std::span<const CpuKernel> cpu_solver_2d();
std::span<const CpuKernel> cpu_solver_3d();
/// Those of the descent (kernels/descent/kernels.h). No energy is in them.
std::span<const CpuKernel> cpu_descent_2d();
std::span<const CpuKernel> cpu_descent_3d();

}  // namespace varimesh::device
