// Sweeps: every free node in turn takes a Newton step on the energy of its star, colour by colour.
#pragma once

#include <span>
#include <vector>

#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/base/work_meter.h"
#include "core/kernels/kernels.h"
#include "core/kernels/operations.h"
#include "core/kernels/p_norm.h"
#include "core/problem/problem.h"
#include "core/solvers/sweeps/colouring.h"

namespace varimesh {

/// What one sweep did.
struct SweepOutcome {
  double residual = 0;       ///< Largest full Newton step of a node, before its line search, divided by the smallest
                             ///< size of a cell around it (sizes.h).
  double gradient_norm = 0;  ///< √ Σ |G|² of the nodes' gradients, each as its node was visited.
  std::int64_t visited = 0;  ///< Nodes that were not skipped.
};

/// The energy and the validity of the whole mesh, from its deformation gradients.
struct ScanOutcome {
  double energy = 0;               ///< Σ w W / Σ w, or the p-norm of the cells' means.
  double min_scaled_jacobian = 0;  ///< At the quadrature points.
  std::int64_t invalid = 0;        ///< Cells with J ≤ 0 at a quadrature point.
};

/// Sweeps over a problem. It keeps the memory that a sweep needs, so a sweep allocates nothing, except the first one
/// and the first after other methods.
class Sweeper {
 public:
  /// `rest`: a sweep skips a node if in each of its cells the nodes have moved by no more than this since its last
  /// visit (the lengths of their moves added up, divided by the size of the cell). Below 0: it skips no node.
  Sweeper(Problem& problem, const ColouredNodes& coloured, const Kernels& kernels, Regularisation regularisation,
          const PNorm& norm, double rest, const Team& team);

  /// Computes the deformation gradients from the positions of the nodes, for every cell in which a sweep has moved a
  /// node since the last rebuild, or for all cells if none are held. This removes the drift that comes from updating
  /// them move by move.
  void rebuild();

  /// Reads or writes which nodes are awake. Right after a rebuild this is the whole state: refresh() restores what is
  /// cached.
  template <class Archive>
  void state(Archive& archive) {
    archive(clock_, visited_at_, moved_at_, moves_);
  }
  /// After the state was read: computes δ and the scans from the positions of the nodes, and frees the deformation
  /// gradients. Returns false if the state belongs to another problem.
  bool refresh();

  /// Scans the cells that changed and sets their δ from their smallest J, for the next sweep. If no deformation
  /// gradients are held, it computes them cell by cell from the positions of the nodes.
  ScanOutcome scan();

  /// Call it after another method has moved nodes (and updated the deformation gradients, if they are held).
  void changed();
  /// The same if the new scans of all cells are known and no deformation gradients are held.
  void changed(std::span<const CellScan> scans);

  /// Reports visits and what the kernels do to `meter`, which may be null and must outlive the object. `point`: the
  /// operations of the kernels' energy.
  void count_with(WorkMeter* meter, const PointOperations& point) {
    meter_ = meter;
    point_ = point;
  }

  /// Visits every free node that is not at rest once, colour by colour. If the team's token interrupts it, nodes that
  /// were visited have moved.
  SweepOutcome sweep();

  /// Wakes every node.
  void wake();

 private:
  struct Visit {
    double step;  ///< In units of the smallest size of a cell around the node.
    double squared_gradient;
    std::int32_t points;  ///< Quadrature points of the star.
    std::int16_t trials;  ///< Energies of the line search.
    bool made;
    bool moved;
  };
  /// Minimises the energy of one star by one Newton step with a line search. `scratch`: NodeStar::kMostNumbers numbers
  /// of the thread.
  Visit visit(std::int32_t rank, std::int64_t now, double* scratch);
  bool at_rest(std::int32_t rank) const;
  /// Quadrature points of the cells around a node.
  std::int32_t points_of_star(std::int32_t rank) const;
  /// Operations of a visit.
  double operations_of(const Visit& visit) const;
  /// How many cells of the set have a mark. `marks`: by cell.
  static std::int64_t marked(const CellSet& set, const std::vector<char>& marks);
  /// Tells the meter what the kernels have done in a loop that all threads have shared since the stopwatch started.
  void count_kernels(double operations, const Stopwatch& watch) const;
  /// After the node moved by `length`: marks its cells as changed, and wakes their nodes if the moves in a cell add up
  /// to more than rest_.
  void note_move(std::int32_t rank, std::int64_t now, double length);
  /// δ² for Regularisation::Patch: one for the star, from its smallest J. Unrepairable cells do not count.
  double star_delta_squared(std::int32_t rank, std::span<StarCell> star) const;
  /// Scans a cell as it is now.
  CellScan scan_of(const CellSet& set, std::int32_t cell) const;
  /// Scans a changed cell, keeps the scan and updates δ.
  void rescan(CellSet& set, std::int32_t cell);
  /// Sets δ of a cell from its scan. If δ changes, scans the cell again, since its energy is another function then.
  void update_delta(CellSet& set, std::int32_t cell);

  Problem& problem_;
  const ColouredNodes& coloured_;
  const Kernels& kernels_;
  int line_size_;
  Regularisation regularisation_;
  PNorm norm_;
  const Team& team_;
  WorkMeter* meter_ = nullptr;
  PointOperations point_{};
  double measure_ = 0;             ///< Σ weight |det A| over all cells.
  UntouchedVector<Visit> visits_;  ///< By rank; a sweep writes all of them.
  std::vector<CellScan> scans_;    ///< By cell.
  std::vector<char> changed_;      ///< By cell: whether it has changed since the last scan.
  std::vector<char> drifted_;      ///< By cell: whether a sweep has changed it since the last rebuild.

  // Which nodes are awake. Times count visits. Groups of one colour share no cell, so no two threads write to one cell.
  double rest_;
  std::int64_t clock_ = 1;
  std::int64_t largest_group_ = 0;  ///< Nodes in the largest group.
  std::int32_t grain_ = 1;          ///< Groups per task.
  /// By rank: time of the last visit; 0: to be visited in the next sweep. Empty before the first sweep.
  std::vector<std::int64_t> visited_at_;
  std::vector<std::int64_t> moved_at_;  ///< By cell: when the moves of its nodes last added up to more than rest_.
  std::vector<double> moves_;           ///< By cell: the moves since then, added up in units of its size.
};

/// The Newton step −H⁻¹ G of a star's expansion, d numbers. Eigenvalues of H that are not positive are made so: each
/// eigenvalue is replaced by its absolute value, and by no less than 1e-3 of the largest.
std::array<double, 3> newton_step(const StarExpansion& expansion, int dimension);

}  // namespace varimesh
