// What the kernels read and write that judge cells: the Bernstein coefficients of J, and J on a lattice of points.
//
// d is the dimension. Arrays of cells have batches of sixteen cells, the lane innermost: batches × row × d × lane, or
// batches × row × lane. Lanes past the last cell repeat it.
#pragma once

#include <cstdint>

namespace varimesh::device {

/// The nodes of cells relative to the first node of each, times a scale.
struct RelativeArguments {
  std::int32_t cells = 0;
  std::int32_t nodes = 0;  ///< Of a cell.
  double scale = 1;
  const std::int32_t* lists = nullptr;  ///< Cells × nodes, in Gmsh's order.
  const double* coordinates = nullptr;  ///< 3 per node of the mesh.
  double* to = nullptr;                 ///< batches × node × d × lane.
};

/// Rows of coefficients from other coefficients (core/validity/formulas/coefficients-inl.h).
struct RowArguments {
  std::int32_t batches = 0;
  std::int32_t rows = 0;                   ///< Of a cell.
  std::int32_t from_rows = 0;              ///< Of a cell in `from`.
  std::int32_t other_rows = 0;             ///< Of a cell in `other`.
  const std::uint32_t* start = nullptr;    ///< rows + 1: where the entries of each row begin.
  const std::uint16_t* columns = nullptr;  ///< By entry: a row of `from`, or a pair of rows of `from` and `other`.
  const double* values = nullptr;          ///< By entry, or two by row.
  const double* factors = nullptr;         ///< By row: what the result is multiplied by.
  const double* from = nullptr;            ///< batches × row × d × lane.
  const double* other = nullptr;           ///< The same.
  double* to = nullptr;                    ///< The same; in coefficient() batches × row × lane.
};

/// What measures cells: detail::measures_of() of core/validity/certificate_kernel.h.
struct MeasureArguments {
  std::int32_t batches = 0;
  std::int32_t nodes = 0, coefficients = 0, corners = 0;  ///< Of a cell.
  std::int32_t of_derivative[3] = {};                     ///< Coefficients of each.
  const double* reciprocal[3] = {};                       ///< By coefficient of a derivative: 1 / multinomial.
  const double* derivative[3] = {};                       ///< batches × coefficient × d × lane.
  const std::uint16_t* corner = nullptr;                  ///< Coefficients of J.
  const double* relative = nullptr;                       ///< batches × node × d × lane.
  const double* jacobian = nullptr;                       ///< batches × coefficient × lane.
  double* to = nullptr;                                   ///< batches × number × lane.
};

/// J at a range of the points of a lattice (core/quality/lattice-inl.h).
struct SampleArguments {
  std::int32_t batches = 0;
  std::int32_t nodes = 0, vertices = 0;  ///< As LatticeTable.
  std::int64_t first = 0, count = 0;     ///< LatticeRows.
  const double* gradients = nullptr;
  const double* straight = nullptr;
  const double* relative = nullptr;  ///< batches × node × d × lane.
  double* progress = nullptr;        ///< batches × number × lane: LatticeProgress.
};

}  // namespace varimesh::device
