// Untangling: makes the cells valid that sweeps and Newton's method leave tangled, patch by patch, by a barrier on
// their Bernstein coefficients.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/kernels/kernels.h"
#include "core/merit/merit.h"
#include "core/problem/problem.h"
#include "core/solvers/guard/guard.h"
#include "core/solvers/untangle/coefficient_energy.h"
#include "core/solvers/untangle/untangle_patch.h"

namespace varimesh {

/// What an outer step of all patches did: the largest values of the patches' UntangleSteps, and the nodes that moved.
struct UntangleOutcome {
  double residual = 0;
  double gradient_norm = 0;
  std::int64_t active_nodes = 0;
};

/// The cells that are uncertified and in no unrepairable group are active, and so are Depth::first layers of cells
/// around them (neighbours by a vertex). A free node may move if all its cells are active. Cells that share such a node
/// form a patch; patches are independent of each other and are untangled at the same time. If cells are left over, they
/// are tried once more with Depth::second layers, and with Depth::stretched around stretched cells, since a tangled
/// boundary layer may have to be moved as deep as that. A cell that two patches have left uncertified is given up for
/// the rest of the run: it starts no patch, and in the patches of others it counts as unrepairable. docs/untangling.md
/// describes the method and says why it ends.
///
/// Call all functions inside team.run(). The result does not depend on the number of threads. Deformation gradients are
/// kept up to date.
class Untangler {
 public:
  static constexpr std::int64_t kUnlimited = std::int64_t{1} << 62;

  /// How many layers of cells a patch has around an uncertified cell: in the first try, in the second try, and in the
  /// second try around a stretched cell.
  struct Depth {
    int first = 1, second = 2, stretched = 4;
  };

  /// By cell (CellSet::first + cell): how many patches have ended without certifying it. The caller keeps it from one
  /// untangler of a run to the next.
  using FailedStarts = std::vector<std::uint8_t>;

  /// Takes the problem back to the state that the guard has kept, so that no certificate is lost, and finds the patches
  /// there.
  ///
  /// `failed_starts`: empty before the first untangler of a run. `hessian_bytes`: the memory that all patches have
  /// together for the Hessians of their cells. If they need more, they borrow `spare`. A Hessian that finds no room is
  /// computed again for every product, so memory decides the time that a step takes, but not its result.
  Untangler(Problem& problem, const Kernels& kernels, Guard& guard, const Team& team, FailedStarts& failed_starts,
            Depth depth, std::int64_t hessian_bytes = kUnlimited, SpareMemory spare = {});

  /// Finds the patches in the problem's present state instead. Cells that have lost their certificate there are made
  /// valid from where they are, so the others need not go back with them. Its state cannot be written.
  struct FromHere {};
  Untangler(FromHere, Problem& problem, const Kernels& kernels, Guard& guard, const Team& team,
            FailedStarts& failed_starts, Depth depth, std::int64_t hessian_bytes = kUnlimited, SpareMemory spare = {});

  /// An untangler whose state is read next.
  struct ToBeRead {};
  Untangler(ToBeRead, Problem& problem, const Kernels& kernels, Guard& guard, const Team& team,
            FailedStarts& failed_starts, Depth depth, std::int64_t hessian_bytes = kUnlimited, SpareMemory spare = {});

  /// Reads or writes the state, after judge() and before step(), while not done(). The positions of the nodes are not
  /// part of it: they are the problem's.
  template <class Archive>
  void state(Archive& archive) {
    std::vector<double> first = free_positions(problem_, first_positions_);
    std::uint64_t count = patches_.size();
    archive(first, first_repairable_, first_unrepaired_, layers_, count);
    if constexpr (Archive::kReads)
      if (!set_free_positions(problem_, first, first_positions_)) archive.fail();
    for (std::uint64_t i = 0; i < count; ++i) {
      if constexpr (Archive::kReads) {
        if (archive.failed()) return;
        patches_.push_back({UntanglePatch(energies_, problem_.dimension), {}, {}});
      }
      patch_state(archive, patches_[i]);
    }
    if constexpr (Archive::kReads) make_room();
  }

  /// An outer step of every patch that has not ended. After it, let the guard certify the mesh and then call judge().
  UntangleOutcome step();

  /// Keeps the best state of each patch so far. When all patches have ended, the guard certifies the best state without
  /// a lost certificate, and the problem then continues from the best state of all, even if certificates are lost
  /// there, as after a sweep. If that is no better than the state before the untangling, the problem goes back to it,
  /// because other methods may still make progress from there.
  void judge();

  /// Whether every patch has ended.
  bool done() const;

 private:
  struct Best {
    Merit merit;  ///< Its minimum is that of the Bernstein coefficients, min B.
    Eigen::VectorXd positions;
  };
  /// A patch with its best states.
  struct TrackedPatch {
    UntanglePatch patch;
    Best best_without_loss;      ///< The best state in which no cell has lost its certificate.
    Best best;                   ///< The best state of all.
    int fewest_bad = 0;          ///< Fewest cells with a coefficient that is not positive.
    int fewest_uncertified = 0;  ///< Fewest uncertified cells, without the unrepairable ones.
    int without_fewer = 0;       ///< Outer steps since either of these last fell.
    double least_depth = std::numeric_limits<double>::infinity();  ///< Of all outer steps.
    int without_rise = 0;     ///< Outer steps since it last fell by more than a little.
    bool has_gained = false;  ///< Either of the two numbers has fallen.
    bool ended = false;
  };
  /// The present state of a patch according to the guard.
  struct Assessment {
    Merit merit;         ///< As Best::merit; it counts unrepairable cells too.
    int repairable = 0;  ///< Uncertified cells, without the unrepairable ones.
  };
  Assessment assess(const UntanglePatch& patch, std::span<const Standing> standings) const;
  void judge(TrackedPatch& tracked, std::span<const Standing> standings) const;
  template <class Archive>
  void patch_state(Archive& archive, TrackedPatch& tracked) {
    tracked.patch.state(archive);
    if constexpr (Archive::kReads)
      if (archive.failed() || !tracked.patch.gather(problem_)) return archive.fail();
    for (Best* best : {&tracked.best_without_loss, &tracked.best}) {
      std::vector<double> positions(best->positions.begin(), best->positions.end());
      auto uncertified = static_cast<std::int32_t>(best->merit.uncertified);
      double depth = -best->merit.smallest;
      archive(uncertified, depth, positions);
      if constexpr (Archive::kReads) {
        best->merit = {.uncertified = uncertified, .smallest = -depth};
        if (positions.size() != static_cast<std::size_t>(tracked.patch.positions().size())) return archive.fail();
        best->positions = Eigen::Map<const Eigen::VectorXd>(positions.data(), tracked.patch.positions().size());
      }
    }
    archive(tracked.fewest_bad, tracked.fewest_uncertified, tracked.without_fewer, tracked.least_depth,
            tracked.without_rise, tracked.has_gained, tracked.ended);
  }
  /// What the guard knows about the cells, with those that were given up as unrepairable.
  std::vector<Standing> present_standings() const;
  /// Counts the cells that the patches have left uncertified.
  void count_failures();
  /// Ends the untangling, or starts it again with more layers.
  void finish();
  /// Finds the first patches.
  void begin();
  /// Finds the patches with this many layers around the uncertified cells.
  void find_patches(int layers, int stretched_layers);
  /// Makes room for the Hessians of all patches, as far as there is memory.
  void make_room();
  /// Computes all deformation gradients from the positions.
  void rebuild();
  /// Writes the positions of a patch's nodes into the problem, and updates the deformation gradients.
  void write(const UntanglePatch& patch, const Eigen::VectorXd& positions);

  Problem& problem_;
  const Kernels& kernels_;
  Guard& guard_;
  const Team& team_;
  FailedStarts& failed_starts_;
  Depth depth_;
  std::vector<double> first_positions_;      ///< Positions when the untangling began.
  std::int64_t first_repairable_ = 0;        ///< Guard::repairable() when it began.
  std::int64_t first_unrepaired_ = 0;        ///< Guard::unrepaired() when it began.
  std::vector<CoefficientEnergy> energies_;  ///< By set.
  std::vector<TrackedPatch> patches_;
  HessianRoom room_;
  int layers_ = 0;
};

}  // namespace varimesh
