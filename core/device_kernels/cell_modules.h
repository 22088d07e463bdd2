// The modules of kernels: which shapes, orders and energies have them.
#pragma once

#include <optional>

#include "core/device/device.h"
#include "core/energy/material.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::device {

/// The kernels for cells of one shape and order whose targets are constant in each, and for the energy of a material;
/// none if there are none. They run in the processor's place for every energy; whether they run on a card depends on
/// the build (KernelImage::packed).
std::optional<KernelImage> cell_kernels(Shape shape, int order, const Material& material);

/// The kernels for all other cells in 2 or 3 dimensions.
KernelImage general_kernels(int dimension, const Material& material);

/// The kernels of Newton's method besides those of the cells (kernels/solver_kernels.h).
KernelImage solver_kernels(int dimension);

}  // namespace varimesh::device
