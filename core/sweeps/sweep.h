// Node-wise Newton in coloured sweeps: every free node in turn minimises the energy of its star.
#pragma once

#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/kernels/kernels.h"
#include "core/kernels/p_norm.h"
#include "core/problem/problem.h"
#include "core/sweeps/schedule.h"

namespace varimesh {

/// What one sweep did. Lengths are relative to the diagonal of the bounding box.
struct SweepOutcome {
  double residual = 0;       ///< Largest full Newton step of a node, before its line search.
  double gradient_norm = 0;  ///< √ Σ |G|² of the nodes' gradients, each as its node was visited.
  std::int64_t visited = 0;
};

/// What the deformation gradients say of the whole mesh.
struct ScanOutcome {
  double energy = 0;               ///< Σ w W / Σ w, or the p-norm of the cells' means.
  double min_scaled_jacobian = 0;  ///< At the quadrature points.
  std::int64_t invalid = 0;        ///< Cells with J ≤ 0 at a quadrature point.
};

/// Sweeps over a problem. Keeps what a sweep needs, so that nothing is allocated inside one but the first after other
/// methods, or after none.
class Sweeper {
 public:
  /// `rest`: a node is passed over while none of its cells has seen its nodes move by more than this (their moves
  /// added up, relative to the diagonal of the bounding box) since its last visit; below 0: none is passed over.
  Sweeper(Problem& problem, const Schedule& schedule, const Kernels& kernels, Regularisation regularisation,
          const PNorm& norm, double rest, const Team& team);

  /// Deformation gradients from the nodes' positions, of every cell in which a sweep has moved one since this was done
  /// last (now and then, against drift), and of all where none are kept.
  void rebuild();

  /// Who is awake. Right after a rebuild nothing else matters: what is cached comes back by refresh().
  template <class Archive>
  void state(Archive& archive) {
    archive(clock_, visited_at_, moved_at_, moves_);
  }
  /// After the state was read: δ and what a scan keeps, from the nodes' positions; no deformation gradients are kept.
  /// False where the state was another problem's.
  bool refresh();

  /// Looks at the cells that changed and sets their δ from their own smallest J, for the sweep to come. Where no
  /// deformation gradients are kept it goes by the nodes' positions.
  ScanOutcome scan();

  /// The nodes and, where they are kept, the deformation gradients have changed by other means than a sweep.
  void changed();
  /// The nodes have, these are the cells' scans since, and no deformation gradients are kept.
  void changed(std::span<const CellScan> scans);

  /// Visits every free node that is not at rest once, colour by colour.
  SweepOutcome sweep();

  /// Wakes every node.
  void wake();

 private:
  struct Visit {
    double step = 0;
    double squared_gradient = 0;
    bool made = false;
  };
  /// `scratch`: NodeStar::kMostNumbers that the thread has for the visit.
  Visit visit(std::int32_t rank, std::int64_t now, double* scratch);
  bool at_rest(std::int32_t rank) const;
  /// After the node moved by `length`: its cells have changed, and wake its neighbours where that adds up.
  void note_move(std::int32_t rank, std::int64_t now, double length);
  double star_delta_squared(std::int32_t rank, std::span<StarCell> star) const;
  CellScan look_at(const CellSet& set, std::int32_t cell) const;
  void scan_cell(CellSet& set, std::int32_t cell);
  /// Sets δ from the scan, and does it again where that is another function.
  void judge_cell(CellSet& set, std::int32_t cell);
  static double delta_squared_of(const CellSet& set, std::int32_t cell, const CellScan& scan);

  Problem& problem_;
  const Schedule& schedule_;
  const Kernels& kernels_;
  int line_size_;
  Regularisation regularisation_;
  PNorm norm_;
  const Team& team_;
  double measure_ = 0;           ///< Of all cells.
  std::vector<Visit> visits_;    ///< By rank, so that sums are taken in one order.
  std::vector<CellScan> scans_;  ///< By cell, likewise.
  std::vector<char> changed_;    ///< By cell: since the last scan.
  std::vector<char> drifted_;    ///< By cell: since the last rebuild.

  // Who is awake. Times count visits; cells of one colour have none in common, so no two threads write to one cell.
  double rest_;
  std::int64_t clock_ = 1;
  std::int64_t largest_group_ = 0;
  std::int32_t grain_ = 1;  ///< Groups a task.
  std::vector<std::int64_t>
      visited_at_;  ///< By rank; 0: to be visited again, come what may. Empty before the first sweep.
  std::vector<std::int64_t> moved_at_;  ///< By cell: when it last saw its nodes move far enough.
  std::vector<double> moves_;           ///< By cell: added up since then.
};

/// The step −H⁻¹ G of a star's expansion, d numbers, with the eigenvalues of H made positive where they are not: each
/// is replaced by its absolute value, but by no less than 1e-3 of the largest.
std::array<double, 3> newton_step(const StarExpansion& expansion, int dimension);

}  // namespace varimesh
