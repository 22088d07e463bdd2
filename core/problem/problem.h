// What the solver works on: tables per shape, targets and deformation gradients per cell, positions and free nodes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The quadrature points of a cell are padded to a multiple of this by repeating the last one with weight 0. So a
/// vector of up to 8 doubles never straddles two arrays.
inline constexpr int kPointPadding = 8;

/// All cells of one shape. The innermost index of an array over quadrature points is the point, with length `stride`.
struct CellSet {
  Shape shape = Shape::Triangle;
  int dimension = 0;
  int order = 0;
  int nodes_per_cell = 0;
  int degree = 0;       ///< Degree asked of the quadrature rule.
  int points = 0;       ///< Quadrature points of the rule.
  int stride = 0;       ///< The same, padded.
  bool affine = false;  ///< Each cell's target is the same matrix at all its points.
  std::int32_t count = 0;
  std::int32_t first = 0;  ///< Number of this set's first cell among all cells.

  std::vector<std::int32_t> mesh_cell;  ///< count: the cell's number among the mesh's cells, in the mesh's order.
  std::vector<std::int32_t> nodes;      ///< count × nodes_per_cell, indices of mesh nodes.
  AlignedVector<double> derivatives;    ///< nodes_per_cell × dimension × stride: ∂φ_i/∂ξ_k.
  AlignedVector<double> weights;        ///< stride: quadrature weights, 0 in the padding.
  /// A⁻¹ of the target A (row-major d × d): count × d·d if affine, else count × d·d × stride.
  UntouchedVector<double> inverse_target;
  /// If affine, |det A| (count); else weight times |det A| (count × stride).
  UntouchedVector<double> measure;
  /// For sets that are not affine: cells whose target is the same matrix at all points up to rounding (a
  /// parallelepiped, an extruded triangle). count × (d·d + 1): A⁻¹, row-major, and |det A|, which is 0 for all other
  /// cells. Empty for affine sets.
  std::vector<double> uniform_target;
  /// L of F = L ∇χ_M A⁻¹ (row-major d × d): count × d·d, symmetric, of determinant 1. Empty: L = 1.
  AlignedVector<double> left_factor;
  /// F, row-major: count × d·d × stride. Empty unless hold_deformation() was called; it is the largest array of a set.
  UntouchedVector<double> deformation;
  /// The function of J that the energy needs besides F, ln J or J^(−1/3) (jacobian-inl.h): count × stride. Valid
  /// wherever J > 0; its J may have been rounded differently from the J of F. Empty if the energy needs neither.
  UntouchedVector<double> jacobian_function;
  std::vector<double> energy_slope;   ///< Weight of each cell in Hessian products (the p-norm's slope); empty: 1.
  std::vector<double> delta_squared;  ///< δ² of J' per cell, dimensionless; 0 for a cell with J > 0 at every point.
  std::vector<char> unrepairable;     ///< Cells that no free node can repair, never in the barrier. Empty: none.

  /// Numbers in the F of one cell.
  std::size_t deformation_size() const { return static_cast<std::size_t>(dimension) * dimension * stride; }
  /// Null if F is not held.
  double* deformation_of(std::int32_t cell) {
    return deformation.empty() ? nullptr : deformation.data() + cell * deformation_size();
  }
  const double* deformation_of(std::int32_t cell) const {
    return deformation.empty() ? nullptr : deformation.data() + cell * deformation_size();
  }
  /// Null if the function of J is not held.
  double* jacobian_function_of(std::int32_t cell) {
    return jacobian_function.empty() ? nullptr : jacobian_function.data() + static_cast<std::size_t>(cell) * stride;
  }
  const double* jacobian_function_of(std::int32_t cell) const {
    return jacobian_function.empty() ? nullptr : jacobian_function.data() + static_cast<std::size_t>(cell) * stride;
  }
  const double* inverse_target_of(std::int32_t cell) const {
    return inverse_target.data() + static_cast<std::size_t>(cell) * dimension * dimension * (affine ? 1 : stride);
  }
  /// d·d + 1 numbers; null if the cell has none.
  const double* uniform_target_of(std::int32_t cell) const {
    const std::size_t size = static_cast<std::size_t>(dimension) * dimension + 1;
    const double* of_cell = uniform_target.empty() ? nullptr : uniform_target.data() + cell * size;
    return of_cell != nullptr && of_cell[size - 1] > 0 ? of_cell : nullptr;
  }
  /// Null: L = 1.
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
  std::int32_t cell = 0;   ///< Number of the cell within its set.
  std::int16_t set = 0;    ///< Index in Problem::sets.
  std::int16_t local = 0;  ///< Local number of the node in the cell.
};

/// Everything the optimiser works on. Coordinates are relative, (x − centre)/diagonal of the bounding box, so they have
/// no unit.
struct Problem {
  int dimension = 0;
  std::vector<CellSet> sets;
  std::int32_t cells = 0;
  std::vector<std::int32_t> cluster;  ///< By cell (set.first + cell): the number of its cluster (clusters.h).
  std::int32_t clusters = 0;
  std::vector<double> positions;      ///< Of the optimised nodes: `dimension` numbers per node, interleaved.
  std::vector<std::int32_t> free;     ///< Nodes that may move, in the order in which they first occur in the cells.
  std::vector<std::int64_t> offsets;  ///< free.size() + 1: where each free node's incidences begin.
  std::vector<Incidence> incidences;  ///< Of one node in the order of the cells (set, then cell).
  std::vector<float> cell_size;       ///< By cell (set.first + cell): its shortest height (sizes.h).
  std::vector<float> inverse_size;    ///< By rank: 1 / the smallest size of a cell around the free node.
};

/// Groups the cells by shape and, within a shape, by cluster; builds the tables and lists the incidences of the free
/// nodes. `quadrature_degree` 0 means 2 P. The caller has to set positions, targets and deformation gradients. Call it
/// inside team.run(). The problem does not depend on the number of threads.
///
/// @param fixed for every node of the mesh whether it is fixed
Problem build_problem(const HighOrderMesh& mesh, const std::vector<bool>& fixed, int quadrature_degree,
                      const Team& team = Team(1));

/// Lists the incidences of the free nodes again, after sets were added. problem.positions must have their size. Call it
/// inside team.run().
void list_incidences(Problem& problem, const Team& team);

/// Allocates CellSet::deformation and, if `keeps_function`, CellSet::jacobian_function. Returns whether any of it is
/// new, so that the caller has to compute it.
bool hold_deformation(Problem& problem, bool keeps_function);
bool holds_deformation(const Problem& problem);
/// Frees both.
void drop_deformation(Problem& problem);

/// The positions of the free nodes, d numbers each, taken from the positions of all nodes. Call it inside team.run().
std::vector<double> free_positions(const Problem& problem, std::span<const double> positions,
                                   const Team& team = Team(1));
/// Puts them back. Returns false, and changes nothing, if `free` has the wrong size.
bool set_free_positions(const Problem& problem, const std::vector<double>& free, std::vector<double>& positions);

/// Sets each cell's target to the straight-sided cell on the vertices of `positions`; targets.h has the other targets.
void set_straight_sided_targets(Problem& problem);

}  // namespace varimesh
