// How many floating-point operations the kernels of the Hessian make for one cell.
#pragma once

#include <vector>

#include "core/kernels/hessian/batches.h"
#include "core/kernels/operations.h"

namespace varimesh {

/// Of HessianKernels::linearise() or gradient(): the stress at every point, and its sum with the derivatives of every
/// basis function. Turning F into 16 bits is not counted.
double gradient_operations(const CellSet& cells, const PointOperations& point);

/// Of HessianKernels::node_blocks(): a tensor at every point, and its sum with the squares of the derivatives of every
/// basis function.
double block_operations(const CellSet& cells, const PointOperations& point);

/// Of HessianKernels::apply(): the gradient of the direction at every point and its transpose, both folded by the
/// cell's mirror symmetries, and the change of the stress at every point.
double product_operations(const BatchSet& set, const PointOperations& point);

/// The operations of one call for every cell of a mesh.
struct MeshOperations {
  double scan = 0;      ///< Kernels::deform() and scan().
  double gradient = 0;  ///< HessianKernels::linearise() or gradient().
  double blocks = 0;    ///< HessianKernels::node_blocks().
  double product = 0;   ///< HessianKernels::apply().
};
MeshOperations mesh_operations(const std::vector<BatchSet>& batches, const PointOperations& point);

}  // namespace varimesh
