// What the kernels of a device read and write, for the program that launches them and for the kernels themselves.
//
// The arrays of a set of cells are those of BatchSet: batches of sixteen cells, the lane innermost; lanes past the last
// cell repeat it, with slope 0. The points are in the order of BatchSet's slots. So what the processor has linearised a
// device can multiply, and the other way round.
#pragma once

#include <cstdint>

#include "core/energy/material.h"

namespace varimesh::device {

/// The reference cell of the kernels that keep cells in registers (splits.h). T: double or float.
template <class T>
struct CellTables {
  std::int32_t bases = 0;    ///< Points of the base; of a simplex all points.
  std::int32_t heights = 1;  ///< Points along a column.
  /// For each point of the base, part, k < d − 1 and column of the part ∂b/∂ξ_k, then for each column b; of a simplex
  /// ∂φ/∂ξ_k for k < d. Zeros for missing columns, and for as many more points as a turn needs. Then, for each height
  /// and layer, l and l'.
  const T* derivatives = nullptr;
  const std::int32_t* nodes = nullptr;  ///< columns × layers: the local number of the node; null: a simplex.
  const std::int32_t* slots = nullptr;  ///< heights × bases: the slot of the point; null: a simplex.
};

/// A set of cells of one shape. Those of simplices have targets that are the same at all points of a cell.
struct CellArguments {
  Material material;
  std::int32_t batches = 0;
  std::int32_t points = 0;
  bool affine = true;               ///< CellSet::affine.
  CellTables<double> tables;        ///< As the kernel splits cells.
  const double* weights = nullptr;  ///< points.

  // The cells.
  const std::int32_t* cell_nodes = nullptr;  ///< batches × node × lane: the node's number.
  const double* inverse_target = nullptr;    ///< batches × (affine ? 1 : points) × d·d × lane: A⁻¹.
  const double* left_factor = nullptr;       ///< batches × d·d × lane; null: L = 1.
  const double* measure = nullptr;           ///< batches × (affine ? 1 : points) × lane: |det A|.
  const double* delta_squared = nullptr;     ///< batches × lane.
  const double* slope = nullptr;             ///< batches × lane: CellSet::energy_slope.
  const double* positions = nullptr;         ///< d per node.

  // Results.
  double* scans = nullptr;         ///< batches × 3 × lane: energy, smallest J, scaled Jacobian (CellScan).
  float* contributions = nullptr;  ///< As BatchSet::contributions of width 2 d.
  float* linearisation = nullptr;  ///< As BatchSet.
  std::int16_t* deformation = nullptr;
  float* mean = nullptr;
};

/// A product of the Hessian with a direction, in each cell of a set.
struct ProductArguments {
  Material material;
  std::int32_t batches = 0;
  std::int32_t points = 0;
  bool affine = true;
  CellTables<float> tables;
  const double* inverse_target = nullptr;
  const double* left_factor = nullptr;
  const float* linearisation = nullptr;
  const std::int16_t* deformation = nullptr;
  const float* mean = nullptr;
  const std::int32_t* ranks = nullptr;  ///< As BatchSet::ranks.
  const float* direction = nullptr;     ///< d per free node, then d zeros.
  float* contributions = nullptr;       ///< As BatchSet::contributions of width d.
};

/// A set of cells of any shape, order and targets, for the kernels that work point by point and node by node.
struct GeneralArguments {
  Material material;
  std::int32_t batches = 0;
  std::int32_t points = 0;
  std::int32_t nodes = 0;                    ///< Of a cell.
  bool affine = false;                       ///< CellSet::affine.
  const double* derivatives = nullptr;       ///< points × d × nodes.
  const double* weights = nullptr;           ///< points.
  const std::int32_t* cell_nodes = nullptr;  ///< CellArguments::cell_nodes.
  const double* inverse_target = nullptr;    ///< batches × (affine ? 1 : points) × d·d × lane.
  const double* left_factor = nullptr;
  const double* measure = nullptr;  ///< batches × (affine ? 1 : points) × lane: |det A|.
  const double* delta_squared = nullptr;
  const double* slope = nullptr;
  const double* positions = nullptr;
  const std::int32_t* ranks = nullptr;
  const float* direction = nullptr;

  double* fields = nullptr;  ///< batches × points × d·d × lane: F, then w P A⁻ᵀ.
  float* changes = nullptr;  ///< The same memory, of floats: w dP A⁻ᵀ.
  double* scans = nullptr;   ///< The rest as in CellArguments and ProductArguments.
  float* contributions = nullptr;
  float* linearisation = nullptr;
  std::int16_t* deformation = nullptr;
  float* mean = nullptr;

  const float* cell_gradients = nullptr;  ///< NormArguments::gradients; null: no p-norm.
  float* tensors = nullptr;               ///< By cell: its mean tensor, as HessianKernels::mean_tensors has it.
};

/// The p-norm's own term, in the cells of a set.
struct NormArguments {
  std::int32_t batches = 0;
  std::int32_t nodes = 0;          ///< Of a cell.
  const double* factor = nullptr;  ///< batches × lane: √φ''/φ'; 0 where φ' is 0.
  float* gradients = nullptr;      ///< batches × node × lane × d: √φ'' g.
  float* along = nullptr;          ///< batches × lane: √φ'' g · direction.
  const std::int32_t* ranks = nullptr;
  const float* direction = nullptr;
  float* contributions = nullptr;  ///< Of width 2 d after a gradient, of width d after a product.
};

/// Sums over the cells of each node, of the contributions of all sets.
struct SumArguments {
  std::int32_t nodes = 0;                 ///< Free nodes.
  const std::int64_t* offsets = nullptr;  ///< nodes + 1: Problem::offsets.
  const std::int64_t* places = nullptr;   ///< By incidence: where its contribution is, in units of a contribution.
  const float* contributions = nullptr;   ///< Of width d for a product, else of width 2 d.
  const float* direction = nullptr;       ///< d per node.
  float* product = nullptr;               ///< d per node.
  double* gradient = nullptr;             ///< d per node.
  double* along = nullptr;                ///< By block of threads: its part of direction · product.
  double scale = 1;                       ///< What the gradient is multiplied by.
};

}  // namespace varimesh::device
