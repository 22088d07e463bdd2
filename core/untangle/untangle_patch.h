// One patch of cells to be untangled: its free nodes move, and nothing outside of it notices.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/untangle/coefficient_energy.h"

namespace varimesh {

/// What an outer step did. Lengths are relative to the diagonal of the bounding box.
struct UntangleStep {
  double residual = 0;       ///< Largest displacement of a node in a full Newton step.
  double gradient_norm = 0;  ///< At the beginning.
};

/// Minimises the sum of CoefficientEnergy over a patch's cells while ε goes to zero by the schedule of V. Garanzha,
/// I. Kaporin, L. Kudryavtseva, F. Protais, N. Ray, D. Sokolov, Foldover-free maps in 50 lines of code, ACM Trans.
/// Graph. 40, 2021: with D the smallest coefficient and E₀, E₁ the energy before and after the step at its ε,
///
///     σ = max(0.3, 1 − E₁/E₀),   m = (1 − σ) χ(D, ε),   ε ← 2 √(m (m − D)) where D ≤ m, else 1e-10;
///
/// so that χ(D, ε) becomes m: the barrier comes closer by the part that the energy fell. At first ε = |D|/5.
class UntanglePatch {
 public:
  struct Member {
    std::int16_t set = 0;
    CoefficientEnergy::Cell cell;
    std::vector<std::int32_t> unknown;  ///< Number among the patch's nodes of each of the cell's free nodes.
  };

  /// `energies` has one a set and must outlive the patch. `members`: by set and cell.
  UntanglePatch(const std::vector<CoefficientEnergy>& energies, std::vector<Member> members,
                std::vector<std::int32_t> nodes, int dimension);

  /// An empty one, whose state is to be read.
  UntanglePatch(const std::vector<CoefficientEnergy>& energies, int dimension)
      : energies_(energies), dimension_(dimension) {}

  /// All but positions, which the problem has.
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
  /// After the state was read: takes the rest from the problem, whose nodes are where the patch has them. False where
  /// the state was another problem's.
  bool gather(const Problem& problem);

  /// At most three Newton steps, then the next ε.
  UntangleStep step(const Team& team);

  /// The free nodes, as the mesh has them, and d numbers for each: where they are.
  const std::vector<std::int32_t>& nodes() const { return nodes_; }
  const Eigen::VectorXd& positions() const { return positions_; }
  const std::vector<Member>& members() const { return members_; }

  /// The smallest coefficient, and how many cells have one that is not positive.
  double smallest_coefficient() const { return smallest_; }
  int bad_cells() const { return bad_; }

 private:
  void place(const Eigen::VectorXd& positions);
  double value(const Team& team) const;
  /// Gradient and the cells' Hessians; returns the energy.
  double expand(const Team& team);
  /// Solves H x = −G with conjugate gradients.
  Eigen::VectorXd direction(const Team& team) const;
  Eigen::VectorXd multiply(const Eigen::VectorXd& x, const Team& team) const;
  /// Takes the step, or part or a multiple of it; false where nothing lowers the energy.
  bool search(const Eigen::VectorXd& step, double before, const Team& team);
  void look_at_coefficients();
  void next_epsilon(double before, double after);

  const std::vector<CoefficientEnergy>& energies_;
  std::vector<Member> members_;
  std::vector<std::int32_t> nodes_;
  int dimension_;
  Eigen::VectorXd positions_;
  double epsilon_ = 0, smallest_ = 0;
  int bad_ = 0;
  Eigen::VectorXd gradient_;
  std::vector<CoefficientEnergy::Expansion> expansions_;  ///< By member.
};

}  // namespace varimesh
