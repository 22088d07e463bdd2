// The energy of the cells of a mesh as a function of all its nodes. Internal to core/slide.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "core/kernels/hessian/batches.h"
#include "core/kernels/kernels.h"
#include "core/preconditioner/reduction.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"

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

  /// The energy with the nodes at `coordinates` (3 per node of the mesh, in its unit of length); infinite if δ = 0 and
  /// J ≤ 0 at a quadrature point. All that follows is about these coordinates.
  double energy(std::span<const double> coordinates);
  /// The smallest J of all cells.
  double least() const { return least_; }

  /// Sets the gradient (3 per rank) and each node's own block of the Hessian (lower triangle by rows), by lengths
  /// relative to the diagonal. With `positive`, the Hessian is replaced by a positive semidefinite part of it: the
  /// terms with f_J ∂²J are left out, and f_JJ is at least λ/(J² + δ²).
  void linearise(bool positive, std::vector<double>& gradient, std::vector<std::array<double, 6>>& blocks);
  /// product = Hessian times direction, as of the last linearise(). `direction`: 3 floats per rank, then padded(3)
  /// zeros.
  void multiply(std::span<const float> direction, std::span<float> product);

 private:
  void scan();
  /// Replaces what HessianKernels::linearise() has kept of a batch by the positive part.
  void keep_positive_part(std::size_t set, std::int32_t batch, const double* deformation);

  const Team& team_;
  Frame frame_;
  Problem problem_;
  std::size_t curved_sets_ = 0;  ///< The sets after these have straight-sided cells.
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
  std::vector<BatchSet> batches_;
  std::vector<CellScan> scans_;  ///< By cell.
  Reduction reduction_;
  double least_ = 0, delta_ = 0;
};

}  // namespace varimesh::detail
