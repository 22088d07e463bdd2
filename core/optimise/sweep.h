// Node-wise Newton in coloured sweeps: every free node in turn minimises the energy of its patch.
#pragma once

#include <vector>

#include "core/optimise/cells.h"
#include "core/optimise/kernels.h"
#include "core/optimise/p_norm.h"
#include "core/optimise/schedule.h"
#include "core/team.h"

namespace varimesh {

/// What one sweep did. Lengths are relative to the diagonal of the bounding box.
struct SweepReport {
  double residual = 0;       ///< Largest full Newton step of a node, before its line search.
  double gradient_norm = 0;  ///< √ Σ |G|² of the nodes' gradients, each as its node was visited.
  std::int64_t visited = 0;
};

/// What the cached deformation gradients say of the whole mesh.
struct ScanReport {
  double energy = 0;               ///< Σ w W / Σ w, or the p-norm of the cells' means.
  double min_scaled_jacobian = 0;  ///< At the quadrature points.
  std::int64_t invalid = 0;        ///< Cells with J ≤ 0 at a quadrature point.
};

/// Sweeps over a problem. Keeps what a sweep needs, so that nothing is allocated inside one.
class Sweeper {
 public:
  Sweeper(Problem& problem, const Schedule& schedule, const Kernels& kernels, Regularisation regularisation,
          const PNorm& norm, const Team& team);

  /// Deformation gradients of every cell from the nodes' positions (at the start, and now and then against drift).
  void rebuild();

  /// Looks at every cell and sets its δ from its own smallest J, for the sweep to come.
  ScanReport scan();

  /// Visits every free node once, colour by colour.
  SweepReport sweep();

 private:
  struct Visit {
    double step = 0;
    double gradient = 0;
  };
  Visit visit(std::int32_t rank);

  Problem& problem_;
  const Schedule& schedule_;
  const Kernels& kernels_;
  Regularisation regularisation_;
  PNorm norm_;
  const Team& team_;
  std::vector<Visit> visits_;    ///< By rank, so that sums are taken in one order.
  std::vector<CellScan> scans_;  ///< By cell, likewise.
};

/// The step −H⁻¹ G of a patch's expansion, d numbers, with the eigenvalues of H made positive where they are not: each
/// is replaced by its absolute value, but by no less than 1e-3 of the largest.
std::array<double, 3> newton_step(const PatchExpansion& expansion, int dimension);

}  // namespace varimesh
