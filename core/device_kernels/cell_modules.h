// The modules of kernels: which shapes, orders and energies have them.
#pragma once

#include <optional>

#include "core/device/device.h"
#include "core/device_kernels/kernels/splits.h"
#include "core/energy/material.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::device {

/// A module for cells of one shape and order.
struct CellModule {
  CellKind kind;
  KernelImage image;
};

/// The kernels that keep cells of this shape and order in registers; none if there are none for the shape, the order or
/// the energy of the material. Whether they run on a card depends on the build (KernelImage::packed).
std::optional<CellModule> cell_kernels(Shape shape, int order, const Material& material);

/// The kernels for all cells in 2 or 3 dimensions, of the energy of the material.
KernelImage general_kernels(int dimension, const Material& material);

/// The kernels of Newton's method besides those of the cells (kernels/solver_kernels.h).
KernelImage solver_kernels(int dimension);

/// The kernels of the descent besides those of the cells (kernels/descent/kernels.h).
KernelImage descent_kernels(int dimension);

/// The kernels that judge cells: certificates and the lattice of the quality report (kernels/judge/kernels.h).
KernelImage judge_kernels(int dimension);

}  // namespace varimesh::device
