// A preconditioner for the modal form: the diagonals of its second derivative in the spaces of all orders.
#pragma once

#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/ranks/whole_reduction.h"
#include "core/solvers/descent/form/modal_form.h"
#include "core/solvers/descent/form/order_space.h"
#include "core/solvers/descent/form/order_tables.h"

namespace varimesh {

/// M⁻¹ = Σ_q I_q D_q⁻¹ I_qᵀ, q = 1 … P, in which I_q are the values at the mesh's nodes of a map of order q, and D_q
/// the diagonal of the second derivative there: the additive method of J. Xu, SIAM Review 34, 1992, with orders in
/// place of refinements. Parts of low degree s weigh κ^(2(P−s)) times as much as those of degree P (modal_form.h), a
/// tiny factor on fine meshes. A diagonal at the nodes of order P would not see such parts. In the space of each order
/// the form is, up to this factor, like a mass matrix, whose diagonal is a good preconditioner whatever the size of the
/// cells.
///
/// The problem may be the part that a rank has of a whole problem. Then all ranks call all functions together, and each
/// rank gets the numbers of its own nodes, with the same bits as without ranks.
class OrderLevels {
 public:
  /// `own` is the space of the problem's order. Call it inside team.run(). All references must outlive the object.
  /// `part`: the part whose problem `problem` is; null: `problem` is a whole problem.
  OrderLevels(const Problem& problem, const OrderSpace& own, const Team& team, const ProblemPart* part = nullptr);

  /// Takes new diagonals; the arguments are those of ModalForm::diagonals(). apply() overwrites ModalForm::room().
  void take_diagonals(ModalForm& form, std::span<const double> stiffness);

  /// By order, from 1: the spaces, and the inverses of their diagonals by free node.
  std::span<const OrderSpace* const> spaces() const { return spaces_; }
  const std::vector<std::vector<double>>& inverse_diagonals() const { return inverse_diagonals_; }

  /// z = M⁻¹ r, d numbers per free node each. Returns r · z. With ranks, z is set at own nodes. Where another rank owns
  /// the node, the number of that rank replaces what was in r.
  double apply(std::span<double> r, std::span<double> z);

 private:
  void restrict_to(std::size_t level, std::span<double> above);
  void raise_from(std::size_t level, std::span<double> above);
  const double* multiply(const detail::LaneMatrix& matrix, const OrderSpace::Set& set, Occurrence taken,
                         std::int32_t first, std::int32_t count, std::span<const double> vector) const;

  const Problem& problem_;
  const Team& team_;
  WholeReduction reduction_;
  std::vector<OrderSpace> lower_;                   ///< [q − 1], q < P.
  std::vector<const OrderSpace*> spaces_;           ///< [q − 1], q ≤ P.
  std::vector<const detail::OrderTables*> tables_;  ///< By Problem::sets.
  std::vector<std::vector<double>> inverse_diagonals_;
  std::vector<UntouchedVector<double>> residuals_, solutions_;  ///< Of lower_.
  std::span<double> contributions_;  ///< By place, of the space that is worked on; the form's room.
};

}  // namespace varimesh
