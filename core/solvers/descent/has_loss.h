// Whether the loss of accuracy of a mesh is worth a descent.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "core/base/reduction.h"
#include "core/base/shared_work.h"
#include "core/base/team.h"
#include "core/merit/thresholds.h"
#include "core/mesh/high_order_mesh.h"
#include "core/quality/accuracy/team_accuracy.h"

namespace varimesh {

/// A cell is not worth a move if no part of its map adds more than this to its displacement gradient. In small
/// cells the rounding of coordinates adds as much.
inline constexpr double kRounding = 1e-7;
inline constexpr std::size_t kCellsPerLossTask = 4096;

inline double volume_of(const CellAccuracy& cells, const Team& team) {
  return Reduction(team).sum(cells.volumes.size(), kCellsPerLossTask,
                             [&](std::size_t cell) { return cells.volumes[cell]; });
}

/// What the size of the cells leaves in a solver: the mean of h^2P over the mesh, under a root.
inline double loss_by_size(const CellAccuracy& cells, double volume, const HighOrderMesh& mesh, const Team& team) {
  return std::sqrt(Reduction(team).sum(cells.volumes.size(), kCellsPerLossTask, [&](std::size_t cell) {
    const double share = cells.volumes[cell] / volume;
    return share * std::pow(share, 2.0 * mesh.order / mesh.dimension);
  }));
}

/// Whether a mesh with its nodes at `coordinates`, which keeps invalid cells, is not worth a descent. A solver cannot
/// use such a mesh as it is, so it is worth one only if the loss is not small beside what the size of the cells leaves.
/// `sharers`: as in team_accuracy.h.
inline bool size_decides(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team,
                         const Ranks& sharers) {
  const CellAccuracy cells = cell_accuracy(mesh, team, sharers);
  const double volume = volume_of(cells, team);
  return accuracy(mesh, coordinates, team, one_rank(), sharers).loss <=
         threshold::kLittleLoss * loss_by_size(cells, volume, mesh, team);
}

/// Whether a mesh with this minimum of the scaled Jacobian has a loss that is worth a move. `sharers`: as above.
inline bool has_loss(const HighOrderMesh& mesh, double scaled_jacobian, const Team& team, const Ranks& sharers) {
  const CellAccuracy cells = cell_accuracy(mesh, team, sharers);
  const double volume = volume_of(cells, team);
  if (mesh.order == 2 && scaled_jacobian >= threshold::kGood) {
    const double square = Reduction(team).sum(cells.loss.size(), kCellsPerLossTask, [&](std::size_t cell) {
      return cells.volumes[cell] / volume * cells.loss[cell] * cells.loss[cell];
    });
    if (std::sqrt(square) <= threshold::kLittleLoss * loss_by_size(cells, volume, mesh, team)) return false;
  }
  const auto is_worth_it = [&](std::size_t cell) {
    const double size = std::pow(cells.volumes[cell] / volume, 1.0 / mesh.dimension);
    if (cells.loss[cell] <= threshold::kNoLoss * std::pow(size, mesh.order)) return false;
    const auto parts = std::span(cells.modal_parts).subspan(cell * cells.parts, cells.parts);
    return !std::ranges::all_of(parts, [](double part) { return part <= kRounding; });
  };
  return first_of(team, cells.loss.size(), kCellsPerLossTask, is_worth_it) < cells.loss.size();
}

}  // namespace varimesh
