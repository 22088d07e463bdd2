// The loss of accuracy as a quadratic form of the positions of the nodes.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/problem/problem.h"
#include "core/ranks/whole_reduction.h"
#include "core/solvers/descent/form/order_space.h"
#include "core/solvers/descent/form/part_products.h"
#include "core/terms/part/cell_sum.h"
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// The square of the local loss of accuracy (core/quality/accuracy/team_accuracy.h) with the Jacobian means J of a
/// given mesh:
///
///     Q(x) = 1/N Σ_E Σ_{s=2..P} κ^(2(P+1−s)) 1/|Ê| ∫_Ê |∇χ_s J⁻¹|²,   N the number of cells.
///
/// At that mesh Q is the squared local loss. Q is quadratic in the positions and the same for each coordinate, and 0
/// for straight-sided cells, so it does not depend on where vertices are.
///
/// The problem may be the part that a rank has of a whole problem. Then all ranks call gradient(), multiply() and
/// diagonals() together, and each rank gets the numbers of its own nodes and cells, with the same bits as without
/// ranks.
class ModalForm {
 public:
  /// Takes the frames. `wave` is κ: local_wave() of the mesh. `room`: memory that the form may use, such as
  /// CellEnergy::room(); with less than d numbers per place it takes its own. Call it inside team.run(). All references
  /// and the room must outlive the form. `part`: the part whose problem `problem` is; null: `problem` is a whole
  /// problem.
  ModalForm(const Problem& problem, const OrderSpace& space, double wave, const Team& team, std::span<double> room = {},
            const ProblemPart* part = nullptr);

  /// Takes J anew from problem.positions. Cells with det J = 0 do not count. Call it inside team.run().
  void take_frames();

  /// Q at problem.positions. `gradient`: ∂Q/∂x of the free nodes, d numbers each.
  double gradient(std::span<double> gradient);
  /// By CellSet::first + cell: N times what the cell added to Q in the last gradient(), if no multiply() followed.
  std::span<const double> squared_losses() const { return values_; }
  /// Its second derivative times a direction; both have d numbers per free node.
  void multiply(std::span<const double> direction, std::span<double> product);

  /// The diagonal of the second derivative in the spaces of order 1 … P, one number per free node and the same for each
  /// coordinate. Adds `stiffness` (one number per cell, by CellSet::first + cell) times
  ///     1/N 1/|Ê| ∫_Ê |∇φ J⁻¹|²,
  /// φ being the basis function of the node: the diagonal of a Laplacian. `spaces`: by order, from 1.
  std::vector<std::vector<double>> diagonals(std::span<const OrderSpace* const> spaces,
                                             std::span<const double> stiffness);

  // === For those who compute with the form elsewhere ===
  /// Of a set of the problem.
  const detail::PartProducts& products(std::size_t set) const { return *products_[set]; }
  /// κ^(2(P+1−s)) of a degree s.
  double weight(int degree) const { return weights_[static_cast<std::size_t>(degree)]; }
  /// By CellSet::first + cell: J⁻¹J⁻ᵀ, as PartProducts has the pairs of directions; 0 if det J = 0.
  const std::vector<std::array<double, 6>>& metrics() const { return metrics_; }

  /// Room for d numbers per place, which all functions but the constructor overwrite.
  std::span<double> room() { return contributions_; }

 private:
  void measure(std::size_t set, std::int32_t first, std::int32_t count);
  /// The factors of the products of a part (degree s = part + 2) in a cell, by pair of directions.
  std::array<double, 6> factors(std::size_t cell, std::size_t part) const;
  /// The derivative of N Q for maps of given values at the nodes: half of it along the map itself by cell in values_,
  /// and all of it by place in contributions_. value(set, cell, node, k): in direction k at a node of a cell; `cell`
  /// counts the nodes of the set before it.
  template <class Value>
  void differentiate(const Value& value);
  /// The coordinates of the cells' nodes relative to their first nodes: nodes × (count · d).
  void gather_positions(const CellSet& set, std::int32_t first, std::int32_t count, Eigen::MatrixXd& out) const;

  const Problem& problem_;
  const OrderSpace& space_;
  const Team& team_;
  WholeReduction reduction_;
  std::int32_t all_cells_;                             ///< N.
  std::optional<CellSum> cell_sum_;                    ///< With ranks.
  std::vector<const detail::PartProducts*> products_;  ///< By Problem::sets.
  std::vector<double> weights_;                        ///< By degree s ≤ P: κ^(2(P+1−s)).
  std::vector<std::array<double, 6>> metrics_;  ///< J⁻¹J⁻ᵀ in the order of PartsTable::products; 0 if det J = 0.
  std::vector<double> values_;                  ///< By cell.
  UntouchedVector<double> own_room_;            ///< Empty if there is another.
  std::span<double> contributions_;             ///< d per place.
};

}  // namespace varimesh
