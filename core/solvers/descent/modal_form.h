// The loss of accuracy as a quadratic form of the positions of the nodes.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/reduction.h"
#include "core/base/team.h"
#include "core/problem/problem.h"
#include "core/solvers/descent/order_space.h"

namespace varimesh {

/// The square of the loss of accuracy (core/quality/accuracy/accuracy.h) with the Jacobian means J and the volumes V_E
/// of a given mesh:
///
///     Q(x) = 1/V Σ_E V_E Σ_{s=2..P} (V_E/V)^(2(P+1−s)/d) 1/|Ê| ∫_Ê |∇χ_s J⁻¹|².
///
/// At that mesh Q is the squared loss. Q is quadratic in the positions and the same for each coordinate, and 0 for
/// straight-sided cells, so it does not depend on where vertices are.
class ModalForm {
 public:
  /// Takes the frames. Call it inside team.run(). All references must outlive the form.
  ModalForm(const Problem& problem, const OrderSpace& space, const Team& team);

  /// Takes J and V_E anew from problem.positions. Cells with det J = 0 do not count. Call it inside team.run().
  void take_frames();

  /// Q at problem.positions. `gradient`: ∂Q/∂x of the free nodes, d numbers each.
  double gradient(std::span<double> gradient);

  /// The diagonal of the second derivative in the spaces of order 1 … P, one number per free node and the same for each
  /// coordinate. Adds `stiffness` (one number per cell, by CellSet::first + cell) times
  ///     V_E/V 1/|Ê| ∫_Ê |∇φ J⁻¹|²,
  /// φ being the basis function of the node: the diagonal of a Laplacian. `spaces`: by order, from 1.
  std::vector<std::vector<double>> diagonals(std::span<const OrderSpace* const> spaces,
                                             std::span<const double> stiffness);

  /// By CellSet::first + cell: V_E/V.
  std::span<const double> shares() const { return shares_; }
  /// V, in the problem's unit of length to the power d.
  double volume() const { return volume_; }

 private:
  void measure(std::size_t set, std::int32_t first, std::int32_t count);
  /// The factors of the products of a part (degree s = part + 2) in a cell, by pair of directions.
  std::array<double, 6> factors(std::size_t cell, std::size_t part) const;
  /// The coordinates of the cells' nodes relative to their first nodes: nodes × (count · d).
  void gather_positions(const CellSet& set, std::int32_t first, std::int32_t count, Eigen::MatrixXd& out) const;

  const Problem& problem_;
  const OrderSpace& space_;
  const Team& team_;
  Reduction reduction_;
  std::vector<double> shares_;
  std::vector<double> squared_sizes_;           ///< (V_E/V)^(2/d).
  std::vector<std::array<double, 6>> metrics_;  ///< J⁻¹J⁻ᵀ in the order of PartsTable::products; 0 if det J = 0.
  std::vector<double> values_;                  ///< By cell.
  std::vector<double> contributions_;           ///< d per place.
  double volume_ = 0;
};

}  // namespace varimesh
