// The part of the preconditioner for the most stretched cells of the mesh: dense factors of small groups of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/kernels/hessian/batches.h"
#include "core/problem/problem.h"
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// Σ_p R_pᵀ W_p K_p⁻¹ W_p R_p over groups p of stretched cells. R_p picks the free nodes of the group's cells, K_p is
/// their part of the stiffness matrix of all cells, and W_p is 1/√(number of groups that a node is in).
///
/// A displacement of order 3 or more that varies along a cell a times as long as it is thick has 1/a² of the stiffness
/// that the blocks of its nodes have, and a space of order 2 does not contain it. A few hundred such cells of a large
/// mesh give the matrix many small eigenvalues, which then set the number of products. The dense factors
/// remove them.
///
/// K_p is assembled from the mean tensors of the cells, as the coarse level is, so it is positive definite. Its
/// diagonal is raised by 1e-6.
class StretchedCells {
 public:
  /// A cell counts as stretched if its tensor is this many times as stiff across as along, in the square root: about
  /// its longest edge over its smallest height. In a mesh of 112,000 tetrahedra with 466 of them, 8 and 6 in place of
  /// 12 give two and eight times as many, and no fewer products.
  static constexpr double kLeastStretching = 12;
  /// Cells with more nodes than this do not count: a dense factor would take too long.
  static constexpr int kMostCellNodes = 64;
  /// A group of more than one cell has at most this many free nodes. With 150 in that mesh, factors take three times as
  /// long, and 30 products do what 32 do.
  static constexpr std::size_t kMostNodes = 60;
  /// If more than one cell in this many is stretched, as in a boundary layer, none counts: with factors for a part of
  /// them, an aerofoil takes 740 products in place of 542. The factors of tetrahedra of order 4 take at most 0.2 KiB
  /// per cell of the mesh.
  static constexpr std::int32_t kCellsPerStretched = 64;

  /// `batches`: of the problem. `most_cells`: if more cells are stretched, none counts. Keeps references to problem,
  /// batches, team and part. `part`: null, or the part that a rank has of the problem, and `batches` are that part's.
  /// All ranks call assemble() and add() together. Each has all groups, because there are few.
  StretchedCells(const Problem& problem, const std::vector<BatchSet>& batches, std::int32_t most_cells,
                 const Team& team, const ProblemPart* part = nullptr);

  /// The largest number of stretched cells in a mesh that count.
  static std::int32_t most_cells(const Problem& problem) { return problem.cells / kCellsPerStretched; }

  /// Finds the stretched cells and factors the matrices of their groups. `tensors`: by set, as
  /// HessianKernels::mean_tensors; of a part: by place. Inside team.run().
  void assemble(const std::vector<std::vector<float>>& tensors);

  /// Adds the sum above, applied to r, to z: d floats per own free node. Returns r · what is added, which does not
  /// depend on the number of threads. Inside team.run().
  double add(std::span<const float> r, std::span<float> z);

  struct Group {
    std::vector<std::int32_t> ranks;
    std::vector<std::int32_t> from;     ///< By node: its place in r; with ranks, in what gather_at_groups() returns.
    std::vector<std::int32_t> to;       ///< By node: its place in z; -1 if another rank owns it.
    std::vector<float> weight;          ///< By node: W_p.
    std::vector<float> inverse_factor;  ///< L⁻¹ of K_p = L Lᵀ: lower triangle by rows. Empty: K_p has none.
    std::vector<float> product;         ///< d numbers per node.
    double along = 0;                   ///< r · what the group adds.
  };
  const std::vector<Group>& factors() const { return groups_; }

  /// By group: the ranks of its nodes among the free nodes, ascending.
  std::vector<std::vector<std::int32_t>> groups() const;

 private:
  struct Cell {
    std::int32_t set, cell;
  };

  void assemble_whole(const std::vector<std::vector<float>>& tensors);
  /// With ranks: the tensors of all cells of the problem if there are stretched cells, and not too many; otherwise
  /// nothing.
  std::vector<std::vector<float>> gather_if_stretched(const std::vector<std::vector<float>>& tensors) const;
  /// Sets the places of the groups' nodes in r and z.
  void place_groups();
  /// With ranks: r at the nodes of the groups, first those that the first rank owns.
  std::vector<float> gather_at_groups(std::span<const float> r) const;
  bool is_stretched(Cell at, const std::vector<std::vector<float>>& tensors) const;
  /// The cells that count, in ascending order.
  std::vector<Cell> find(const std::vector<std::vector<float>>& tensors) const;
  /// Sets groups_ without their factors: cells that share at least three nodes are joined as long as the nodes are not
  /// too many.
  void join(const std::vector<Cell>& cells);
  /// The ranks of the cell's free nodes, ascending.
  std::vector<std::int32_t> ranks_of(Cell cell) const;
  template <int d>
  void factorise(Group& group, const std::vector<std::vector<float>>& tensors) const;
  template <int d>
  void apply(Group& group, std::span<const float> r) const;
  /// Of a node of the cell among the free nodes; their number if it is fixed.
  std::int32_t rank(Cell cell, int node) const;

  const Problem& problem_;
  const std::vector<BatchSet>& batches_;
  std::int32_t most_cells_;
  const Team& team_;
  const ProblemPart* part_;
  std::vector<std::int32_t> free_;  ///< With ranks: places_in_free() of the problem.
  /// By set: nodes × nodes × d·d, means of ∂_k φ_a ∂_l φ_b over the reference cell, innermost (k, l). Empty if a set
  /// has cells of more than kMostCellNodes nodes; then no cell counts as stretched.
  std::vector<std::vector<float>> means_;
  std::vector<Group> groups_;
  std::vector<std::int32_t> own_at_groups_;  ///< With ranks: the own free nodes that are in a group, ascending.
};

}  // namespace varimesh
