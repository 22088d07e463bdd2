// One patch of cells to be untangled. Only nodes move whose cells are all in the patch, so nothing changes outside it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/solvers/untangle/coefficient_energy.h"
#include "core/solvers/untangle/hessian_room.h"

namespace varimesh {

/// What an outer step did.
struct UntangleStep {
  double residual = 0;       ///< Largest displacement of a node in a full Newton step, divided by the
                             ///< smallest size of a cell around the node, if find_lengths() was called.
  double gradient_norm = 0;  ///< At the start of the step.
};

/// Minimises the sum of CoefficientEnergy over the cells of a patch while ε goes to zero (next_epsilon() of
/// core/kernels/regularisation.h).
class UntanglePatch {
 public:
  struct Member {
    std::int16_t set = 0;
    CoefficientEnergy::Cell cell;
    std::vector<std::int32_t> unknown;  ///< For each of the cell's free nodes, its number among the patch's nodes.
  };

  /// `energies`: one per set; they must outlive the patch. `members`: sorted by set and cell. `nodes`: the nodes that
  /// move, as numbers of mesh nodes. Looks at the token, which may be null.
  UntanglePatch(const std::vector<CoefficientEnergy>& energies, std::vector<Member> members,
                std::vector<std::int32_t> nodes, int dimension, const StopToken* stop = nullptr);

  /// An empty patch, whose state is read next.
  UntanglePatch(const std::vector<CoefficientEnergy>& energies, int dimension)
      : energies_(energies), dimension_(dimension) {}

  /// Reads or writes everything except positions, which the problem has.
  template <class Archive>
  void state(Archive& archive) {
    std::uint64_t count = members_.size();
    archive(nodes_, epsilon_, smallest_, bad_, count);
    for (std::uint64_t i = 0; i < count; ++i) {
      if constexpr (Archive::kReads) {
        if (archive.failed()) return;
        members_.emplace_back();
      }
      Member& member = members_[i];
      archive(member.set, member.cell.number, member.cell.unrepairable, member.cell.movable);
    }
  }
  /// After the state was read: takes the positions from the problem, whose nodes are where the patch had moved them.
  /// Returns false if the state belongs to another problem.
  bool gather(const Problem& problem);

  /// Takes the sizes of the cells, which the residual is measured by, from the problem. gather() does it too.
  void find_lengths(const Problem& problem);

  /// An outer step: at most three Newton steps, then the next ε. Hessians of cells that `room` has no room for are
  /// computed again for every product, which is slow. The result does not depend on it. If the team's token interrupts
  /// it, the patch and the room are spoilt.
  UntangleStep step(const Team& team, HessianRoom& room);

  /// The nodes that move, as numbers of mesh nodes, and their positions, d numbers each.
  const std::vector<std::int32_t>& nodes() const { return nodes_; }
  const Eigen::VectorXd& positions() const { return positions_; }
  const std::vector<Member>& members() const { return members_; }

  /// The smallest coefficient, and how many cells have one that is not positive.
  double smallest_coefficient() const { return smallest_; }
  int bad_cells() const { return bad_; }
  /// Of the Hessians of all cells.
  std::int64_t hessian_bytes() const;

 private:
  /// Copies these positions to the members' cells.
  void place(const Eigen::VectorXd& positions);
  /// The energy of the patch.
  double value(const Team& team) const;
  /// Sets the gradient, the nodes' blocks and the cells' Hessians, as far as there is room; returns the energy.
  double expand(const Team& team, HessianRoom& room);
  /// Gives back the room of the Hessians.
  void forget_hessians(HessianRoom& room);
  class Objective;
  /// H x
  Eigen::VectorXd multiply(const Eigen::VectorXd& x, const Team& team) const;
  /// Sets smallest_ and bad_.
  void measure_coefficients(const StopToken* stop);

  const std::vector<CoefficientEnergy>& energies_;
  std::vector<Member> members_;
  std::vector<std::int32_t> nodes_;
  Eigen::Index dimension_;
  Eigen::VectorXd positions_;
  std::vector<double> lengths_;  ///< By node of nodes_: the smallest size of its cells.
  double epsilon_ = 0;
  double smallest_ = 0;  ///< The smallest coefficient.
  int bad_ = 0;          ///< Cells with a coefficient that is not positive.
  Eigen::VectorXd gradient_;
  std::vector<CoefficientEnergy::Expansion> expansions_;  ///< By member. The Hessian is empty if there was no room.
  std::vector<Eigen::MatrixXd> blocks_;                   ///< By member: each free node's own block, side by side.
  std::int64_t taken_ = 0;                                ///< Of the room.
};

}  // namespace varimesh
