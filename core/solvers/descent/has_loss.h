// Whether the loss of accuracy of a mesh is worth a descent.
#pragma once

#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>

#include "core/base/team.h"
#include "core/merit/thresholds.h"
#include "core/mesh/high_order_mesh.h"
#include "core/quality/accuracy/team_accuracy.h"

namespace varimesh {

/// A cell is not worth a move if no part of its map adds more than this to its displacement gradient. In small
/// cells the rounding of coordinates adds as much.
inline constexpr double kRounding = 1e-7;

/// What the size of the cells leaves in a solver: the mean of h^2P over the mesh, under a root.
inline double loss_by_size(const CellAccuracy& cells, double volume, const HighOrderMesh& mesh) {
  double size = 0;
  for (const double of_cell : cells.volumes)
    size += of_cell / volume * std::pow(of_cell / volume, 2.0 * mesh.order / mesh.dimension);
  return std::sqrt(size);
}

/// Whether a mesh with its nodes at `coordinates`, which keeps invalid cells, is not worth a descent. A solver cannot
/// use such a mesh as it is, so it is worth one only if the loss is not small beside what the size of the cells leaves.
inline bool size_decides(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team) {
  const CellAccuracy cells = cell_accuracy(mesh, team);
  const double volume = std::accumulate(cells.volumes.begin(), cells.volumes.end(), 0.0);
  return accuracy(mesh, coordinates, team).loss <= threshold::kLittleLoss * loss_by_size(cells, volume, mesh);
}

/// Whether a mesh with this minimum of the scaled Jacobian has a loss that is worth a move.
inline bool has_loss(const HighOrderMesh& mesh, double scaled_jacobian, const Team& team) {
  const CellAccuracy cells = cell_accuracy(mesh, team);
  const double volume = std::accumulate(cells.volumes.begin(), cells.volumes.end(), 0.0);
  if (mesh.order == 2 && scaled_jacobian >= threshold::kGood) {
    double square = 0;
    for (std::size_t cell = 0; cell < cells.loss.size(); ++cell)
      square += cells.volumes[cell] / volume * cells.loss[cell] * cells.loss[cell];
    if (std::sqrt(square) <= threshold::kLittleLoss * loss_by_size(cells, volume, mesh)) return false;
  }
  for (std::size_t cell = 0; cell < cells.loss.size(); ++cell) {
    const double size = std::pow(cells.volumes[cell] / volume, 1.0 / mesh.dimension);
    if (cells.loss[cell] <= threshold::kNoLoss * std::pow(size, mesh.order)) continue;
    for (std::size_t part = cell * cells.parts; part < (cell + 1) * cells.parts; ++part)
      if (!(cells.modal_parts[part] <= kRounding)) return true;
  }
  return false;
}

}  // namespace varimesh
