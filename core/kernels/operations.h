// How many floating-point operations the kernels of an energy make in an evaluation: a number per quadrature point,
// which depends on the energy and the dimension, and a number per quadrature point and node of the cell.
#pragma once

#include "core/energy/material.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Operations per quadrature point of the vectorised kernels, for a valid cell with one target. An addition, a
/// subtraction, a multiplication, a division and a root count as one each, a fused multiplication and addition as two;
/// comparisons, conversions and changes of sign count as none. tests/core/kernels/operations_test.cpp counts them one
/// by one. δ > 0, targets that vary and left factors add a few, which are not counted.
struct PointOperations {
  int expand;        ///< Kernels::expand(), with the room and the function of J that a sweep keeps.
  int energy_after;  ///< Kernels::energy_after() after such an expand().
  int move;          ///< Kernels::move() after such an energy_after().
  int scan;          ///< Kernels::scan() without a function of J.
  int function;      ///< Of these, for the function of J. 0: the energy keeps none.
  int stress;        ///< HessianKernels::linearise() and gradient(): w dW/dF A⁻ᵀ.
  int block;         ///< HessianKernels::node_blocks(): the tensor of the point.
  int product;       ///< HessianKernels::apply(): w dP A⁻ᵀ from the gradient of the direction.
};

/// The operations of this energy in 2 or 3 dimensions.
const PointOperations& point_operations(const Material& material, int dimension);

/// Operations of Kernels::deform() for one cell: the derivatives of `nodes_per_cell` basis functions at every point,
/// then A⁻¹.
inline double deform_operations(const CellSet& set) {
  const double d = set.dimension;
  return set.points * (2 * d * d * set.nodes_per_cell + 2 * d * d * d);
}

/// Operations of Kernels::rebuild() for one cell: deform(), and the determinant and the function of J if it is kept.
inline double rebuild_operations(const CellSet& set, const PointOperations& point) {
  const int determinant = set.dimension == 2 ? 4 : 14;
  return deform_operations(set) + (point.function > 0 ? set.points * double(determinant + point.function) : 0);
}

/// Operations of deform() and scan() for one cell.
inline double scan_operations(const CellSet& set, const PointOperations& point) {
  return deform_operations(set) + static_cast<double>(set.points) * point.scan;
}

/// Operations of Kernels::scan_kept() for one cell.
inline double kept_scan_operations(const CellSet& set, const PointOperations& point) {
  return static_cast<double>(set.points) * (point.scan - point.function);
}

}  // namespace varimesh
