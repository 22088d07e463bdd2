// Derivatives of the local loss in several cells at a time, compiled for every vector unit.
#pragma once

#include <cstddef>
#include <vector>

#include "core/reference/shape.h"
#include "core/solvers/descent/form/order_tables.h"

namespace varimesh::detail {

/// Of one shape and order P, on the optimised nodes. `d` is the dimension of the cell; pairs of directions a ≤ b are in
/// the order 00, 01, 02, 11, 12, 22, without those of a third direction in 2-D.
struct PartProducts {
  std::size_t d = 0, pairs = 0, nodes = 0, modes = 0;
  std::vector<int> degrees;          ///< By mode: s.
  LanePair to_modes;                 ///< Of order_tables.h.
  std::vector<std::size_t> first;    ///< Row m has the entries first[m] to first[m + 1] − 1.
  std::vector<std::size_t> columns;  ///< By entry.
  /// By entry and pair: the entry of PartsTable::products, twice that if a ≠ b. On quadrilaterals and hexahedra nearly
  /// all entries are 0, on tetrahedra half of them.
  std::vector<double> entries;
};

/// Made once and kept until the program ends.
const PartProducts& part_products(Shape shape, int order);

/// Sets, in kCellLanes cells and with q = Σ_s w_s 1/|Ê| ∫_Ê |∇χ_s J⁻¹|² of each cell, `values` = q and `slopes` =
/// ∂q/∂x.
/// @param weights  w_s of the degree s of each mode: [mode]
/// @param metrics  J⁻¹J⁻ᵀ: [pair][lane]
/// @param x        of the map χ at the nodes: [node][direction][lane]
/// @param room     grows to what is needed
/// @param values   [lane]
/// @param slopes   [node][direction][lane]
void differentiate_parts(const PartProducts& products, const double* weights, const double* metrics, const double* x,
                         std::vector<double>& room, double* values, double* slopes);

}  // namespace varimesh::detail
