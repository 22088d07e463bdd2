// The reference cell as the kernels that keep cells in registers need it: a base times a line (kernels/splits.h).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/device_kernels/kernels/splits.h"
#include "core/problem/problem.h"

namespace varimesh::device {

/// The base and the line of the cells of a set, and which nodes and points of the cells are where.
struct SplitTables {
  CellKind kind;
  int bases = 0;    ///< Points of the base; of a simplex all points.
  int heights = 1;  ///< Points along a column.
  std::vector<double> base;  ///< bases × d × columns: ∂b/∂ξ_k for k < d − 1, then b; of a simplex ∂φ/∂ξ_k for k < d.
  std::vector<double> line;         ///< heights × layers × 2: l and l'; of a simplex empty.
  std::vector<std::int32_t> nodes;  ///< CellTables::nodes.
  std::vector<std::int32_t> slots;  ///< CellTables::slots.

  /// CellTables::derivatives for a kernel that splits a cell into this many parts.
  template <class T>
  std::vector<T> derivatives(int parts) const;
};

/// None if the points of the set are not points of a base times points of a line.
///
/// @param slots  by slot: the quadrature point (FoldedGradient::points)
std::optional<SplitTables> split_tables(const CellSet& set, CellKind kind, const std::vector<int>& slots);

}  // namespace varimesh::device
