// The cells of a mesh as the kernels see them: tables a shape, targets and deformation gradients a cell.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/aligned.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Quadrature points of a cell are padded to a multiple of this, by repeating the last with weight 0, so that a vector
/// of any width up to 8 doubles never straddles two arrays.
inline constexpr int kPointPadding = 8;

/// All cells of one shape. Arrays over quadrature points come last and are `stride` long.
struct CellSet {
  Shape shape = Shape::Triangle;
  int dimension = 0;
  int order = 0;
  int nodes_per_cell = 0;
  int degree = 0;       ///< Of the quadrature rule asked for.
  int points = 0;       ///< Quadrature points of the rule.
  int stride = 0;       ///< The same, padded.
  bool affine = false;  ///< The target is one matrix a cell.
  std::int32_t count = 0;
  std::int32_t first = 0;  ///< Number of this set's first cell among all cells.

  std::vector<std::int32_t> mesh_cell;  ///< count: the cell's number among the mesh's cells, in the mesh's order.
  std::vector<std::int32_t> nodes;      ///< count × nodes_per_cell, indices of mesh nodes.
  AlignedVector<double> derivatives;    ///< nodes_per_cell × dimension × stride: ∂φ_i/∂ξ_k.
  AlignedVector<double> weights;        ///< stride: quadrature weights, 0 in the padding.
  /// A⁻¹ of the target A (row-major d × d): count × d·d where affine, else count × d·d × stride.
  AlignedVector<double> inverse_target;
  /// |det A| where affine (count), else weight times |det A| (count × stride).
  AlignedVector<double> measure;
  /// Of cells whose target is one matrix up to rounding where the set's vary (a parallelepiped, an extruded
  /// triangle): A⁻¹ and |det A|, count × (d·d + 1), |det A| being 0 for all others. Empty where the set's do not
  /// vary.
  std::vector<double> uniform_target;
  /// L of F = L ∇χ_M A⁻¹ (row-major d × d): count × d·d, symmetric, of determinant 1. Empty: 1.
  AlignedVector<double> left_factor;
  /// F, row-major: count × d·d × stride. Empty while nobody keeps it (hold_deformation): it is the most that a cell
  /// has.
  AlignedVector<double> deformation;
  /// What the energy takes of J at the points, ln J or J^(−1/3) (jacobian-inl.h), beside F: count × stride. Right
  /// wherever J > 0, for a J that may have been rounded otherwise than that of F. Empty where it takes neither.
  AlignedVector<double> jacobian_function;
  std::vector<double> energy_slope;   ///< What products weight each cell with (the p-norm's slope); empty: 1.
  std::vector<double> delta_squared;  ///< δ² of J' a cell, dimensionless; 0 for a cell with J > 0 at every point.
  std::vector<char> unrepairable;     ///< Cells that no free node can repair: never in the barrier. Empty: none.

  /// Numbers in a cell's F.
  std::size_t deformation_size() const { return static_cast<std::size_t>(dimension) * dimension * stride; }
  /// Null where none is kept.
  double* deformation_of(std::int32_t cell) {
    return deformation.empty() ? nullptr : deformation.data() + cell * deformation_size();
  }
  const double* deformation_of(std::int32_t cell) const {
    return deformation.empty() ? nullptr : deformation.data() + cell * deformation_size();
  }
  /// Null where none is kept.
  double* jacobian_function_of(std::int32_t cell) {
    return jacobian_function.empty() ? nullptr : jacobian_function.data() + static_cast<std::size_t>(cell) * stride;
  }
  const double* jacobian_function_of(std::int32_t cell) const {
    return jacobian_function.empty() ? nullptr : jacobian_function.data() + static_cast<std::size_t>(cell) * stride;
  }
  const double* inverse_target_of(std::int32_t cell) const {
    return inverse_target.data() + static_cast<std::size_t>(cell) * dimension * dimension * (affine ? 1 : stride);
  }
  /// d·d + 1 numbers; null where the cell has none.
  const double* uniform_target_of(std::int32_t cell) const {
    const std::size_t size = static_cast<std::size_t>(dimension) * dimension + 1;
    const double* of_cell = uniform_target.empty() ? nullptr : uniform_target.data() + cell * size;
    return of_cell != nullptr && of_cell[size - 1] > 0 ? of_cell : nullptr;
  }
  /// Null: 1.
  const double* left_factor_of(std::int32_t cell) const {
    return left_factor.empty() ? nullptr : left_factor.data() + static_cast<std::size_t>(cell) * dimension * dimension;
  }
  const double* measure_of(std::int32_t cell) const {
    return measure.data() + static_cast<std::size_t>(cell) * (affine ? 1 : stride);
  }
  const double* derivatives_of(int node) const {
    return derivatives.data() + static_cast<std::size_t>(node) * dimension * stride;
  }
};

/// A cell that a node belongs to, and which of the cell's nodes it is.
struct Incidence {
  std::int32_t cell = 0;  ///< Within its set.
  std::int16_t set = 0;
  std::int16_t local = 0;
};

/// Everything the optimiser works on. Coordinates are relative: (x − centre)/diagonal of the bounding box, so that the
/// unit of length plays no part.
struct Problem {
  int dimension = 0;
  std::vector<CellSet> sets;
  std::int32_t cells = 0;
  std::vector<std::int32_t> cluster;  ///< By cell (set.first + cell): cells of one cluster are near each other.
  std::int32_t clusters = 0;
  std::vector<double> positions;      ///< dimension a node, interleaved, of the optimised nodes.
  std::vector<std::int32_t> free;     ///< Nodes that may move, as the cells name them: neighbours are near.
  std::vector<std::int32_t> offsets;  ///< free.size() + 1: where each free node's incidences begin.
  std::vector<Incidence> incidences;
};

/// Groups the cells by shape and, within a shape, by cluster; builds the tables and lists the incidences of the free
/// nodes. `quadrature_degree` 0 means 2 P. Positions, targets and deformation gradients are left to be set.
Problem build_problem(const HighOrderMesh& mesh, const std::vector<bool>& fixed, int quadrature_degree);

/// Makes room for the deformation gradients, and for the energy's function of J where it `keeps_function`, or gives it
/// back. hold: true where the room is new, and they are to be computed.
bool hold_deformation(Problem& problem, bool keeps_function);
bool holds_deformation(const Problem& problem);
void drop_deformation(Problem& problem);

/// What an array of all nodes' positions has of the free ones, d numbers each, and back; false where it is not of that
/// size.
std::vector<double> free_positions(const Problem& problem, const std::vector<double>& positions);
bool set_free_positions(const Problem& problem, const std::vector<double>& free, std::vector<double>& positions);

/// Sets the targets to the straight-sided cells on the vertices of `positions`; targets.h has the others.
void set_straight_sided_targets(Problem& problem);

}  // namespace varimesh
