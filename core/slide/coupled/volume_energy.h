// The energy of the cells of a mesh as a function of all its nodes. Internal to core/slide.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"
#include "core/terms/cell_energy.h"

namespace varimesh::detail {

/// The hyperelastic energy of the curved cells, and with a small weight that of the straight-sided cells on their
/// vertices, which keeps these from turning over. In tetrahedra, the nodes of the lattice are points of the quadrature
/// too, with a small weight. Nodes are those of the file, because the boundary's nodes lie on the
/// geometry there. Lengths are relative to the diagonal of the mesh's box.
class VolumeEnergy {
 public:
  /// The mesh as it is sets the targets. Call it inside team.run(). No cell may be numbered clockwise.
  /// @param fixed  by node: whether it never moves
  VolumeEnergy(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team);
  VolumeEnergy(const VolumeEnergy&) = delete;
  VolumeEnergy& operator=(const VolumeEnergy&) = delete;

  /// The nodes that are not fixed, by rank: their indices in the mesh.
  const std::vector<std::int32_t>& nodes() const { return problem_.free; }
  double diagonal() const { return frame_.diagonal; }
  /// The volumes of the straight-sided cells as they came, in cubes of the diagonal, by the mesh's order of cells.
  std::vector<double> volumes() const;

  /// δ of J' = (J + √(J² + δ²))/2 for all cells. 0: J must stay positive.
  void set_delta(double delta);

  /// Puts the nodes to `coordinates` (3 per node of the mesh, in its unit of length).
  void place(std::span<const double> coordinates);
  /// The energy there; infinite if δ = 0 and J ≤ 0 at a quadrature point.
  double energy(std::span<const double> coordinates);
  /// The smallest J of all cells, as of the last energy() or linearise() of cells().
  double least() const;

  /// All cells, by lengths relative to the diagonal.
  CellEnergy& cells() { return *cells_; }

 private:
  const Team& team_;
  Frame frame_;
  Problem problem_;
  std::size_t curved_sets_ = 0;  ///< The sets after these have straight-sided cells.
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
  std::optional<CellEnergy> cells_;
};

}  // namespace varimesh::detail
