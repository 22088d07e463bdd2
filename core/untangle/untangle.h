// The last resort: cells that sweeps and Newton leave tangled, patch by patch, by their Bernstein coefficients.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/guard/guard.h"
#include "core/kernels/kernels.h"
#include "core/problem/problem.h"
#include "core/untangle/coefficient_energy.h"
#include "core/untangle/untangle_patch.h"

namespace varimesh {

/// What an outer step of all patches did.
struct UntangleOutcome {
  double residual = 0;
  double gradient_norm = 0;
  std::int64_t active_nodes = 0;
};

/// Active are the cells that are uncertified and in no unrepairable group, and two layers of cells (neighbours by a
/// vertex) round them; free are the nodes whose cells are all active. Cells that share a free node make a patch;
/// patches are independent of each other and run at the same time. What is left is tried once more with four layers, as
/// deep as a tangled boundary layer may have to be moved. docs/untangling.md has the method, and why it ends.
///
/// Everything is to be called inside team.run(), and the result does not depend on the number of threads. Deformation
/// gradients are kept up to date.
class Untangler {
 public:
  /// Takes the problem to the guard's best state, so that nothing is lost, and chooses the patches there.
  Untangler(Problem& problem, const Kernels& kernels, Guard& guard, const Team& team);

  /// One whose state is to be read.
  struct ToBeRead {};
  Untangler(ToBeRead, Problem& problem, const Kernels& kernels, Guard& guard, const Team& team);

  /// Between judge() and step(), where not done(). Positions of the nodes are the problem's.
  template <class Archive>
  void state(Archive& archive) {
    std::vector<double> first = free_positions(problem_, first_positions_);
    std::uint64_t count = places_.size();
    archive(first, first_repairable_, first_unrepaired_, layers_, count);
    if constexpr (Archive::kReads)
      if (!set_free_positions(problem_, first, first_positions_)) archive.fail();
    for (std::uint64_t i = 0; i < count; ++i) {
      if constexpr (Archive::kReads) {
        if (archive.failed()) return;
        places_.push_back({UntanglePatch(energies_, problem_.dimension), {}, {}});
      }
      place_state(archive, places_[i]);
    }
  }

  /// An outer step of every patch that goes on. The guard is to look at what came of it, then judge() is to be called.
  UntangleOutcome step();

  /// Keeps the best that each patch has been at. Where all have come to their end, the guard sees the best without a
  /// loss, and the problem goes on from the best, lost cells or not, as it may from a sweep. Where that is no better
  /// than what the untangling began with, the problem goes back there: other methods may find a way from it.
  void judge();

  /// Whether every patch has come to its end.
  bool done() const;

 private:
  /// How good a patch is, lower is better.
  struct Rank {
    int uncertified = 0;  ///< Cells, lost or unrepairable ones, too.
    double depth = 0;     ///< −min B
    auto operator<=>(const Rank&) const = default;
  };
  struct Best {
    Rank rank;
    Eigen::VectorXd positions;
  };
  struct Place {
    UntanglePatch patch;
    Best safe, any;              ///< Without a lost cell, and whatever is lost.
    int fewest_bad = 0;          ///< Cells with a coefficient that is not positive.
    int fewest_uncertified = 0;  ///< Of those that can be repaired.
    int without_fewer = 0;       ///< Outer steps without fewer of either.
    bool ended = false;
  };
  /// What the standings say of a patch as it is.
  struct Look {
    Rank rank;
    int repairable = 0;  ///< Uncertified cells that can be repaired.
    bool lost = false;
  };
  Look look(const UntanglePatch& patch, std::span<const Standing> standings) const;
  void judge(Place& place, std::span<const Standing> standings) const;
  template <class Archive>
  void place_state(Archive& archive, Place& place) {
    place.patch.state(archive);
    if constexpr (Archive::kReads)
      if (archive.failed() || !place.patch.gather(problem_)) return archive.fail();
    for (Best* best : {&place.safe, &place.any}) {
      std::vector<double> positions(best->positions.begin(), best->positions.end());
      archive(best->rank.uncertified, best->rank.depth, positions);
      if constexpr (Archive::kReads) {
        if (positions.size() != static_cast<std::size_t>(place.patch.positions().size())) return archive.fail();
        best->positions = Eigen::Map<const Eigen::VectorXd>(positions.data(), place.patch.positions().size());
      }
    }
    archive(place.fewest_bad, place.fewest_uncertified, place.without_fewer, place.ended);
  }
  void finish();
  /// Patches with so many layers.
  void choose(int layers);
  void rebuild();
  void write(const UntanglePatch& patch, const Eigen::VectorXd& positions);

  Problem& problem_;
  const Kernels& kernels_;
  Guard& guard_;
  const Team& team_;
  std::vector<double> first_positions_;  ///< Where the problem was when the untangling began.
  std::int64_t first_repairable_ = 0, first_unrepaired_ = 0;
  std::vector<CoefficientEnergy> energies_;
  std::vector<Place> places_;
  int layers_ = 0;
};

}  // namespace varimesh
