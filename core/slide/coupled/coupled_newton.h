// Newton's method for all nodes of a mesh together, those on its boundary included. Internal to core/slide.
#pragma once

#include <span>
#include <vector>

#include "core/base/conjugate_gradients.h"
#include "core/slide/coupled/boundary_energy.h"
#include "core/slide/coupled/volume_energy.h"

namespace varimesh::detail {

/// Where all nodes of the mesh are.
struct CoupledState {
  std::vector<double> coordinates;  ///< 3 per node of the mesh.
  BoundaryEnergy::Places places;
};

/// Minimises E(volume) + w E(boundary) (volume_energy.h, boundary_energy.h).
///
/// A step solves for x += T q of all nodes, with T a basis of the tangents of nodes that slide and the identity for
/// nodes inside the mesh, by conjugate gradients on the Hessian TᵀHT plus the curvature of the entities. The
/// preconditioner is each node's own block.
class CoupledNewton {
 public:
  /// Both must outlive the object. boundary.prepare() has been called.
  CoupledNewton(VolumeEnergy& volume, BoundaryEnergy& boundary, std::vector<double> coordinates, const Team& team);

  double boundary_weight = 1;   ///< w.
  bool boundary_slides = true;  ///< Otherwise only the nodes inside the mesh move.

  struct Outcome {
    bool moved = false;
    double share = 0;  ///< The part of the Newton step that was taken.
    double fall = 0;   ///< Of the energy, relative to it.
    int products = 0;  ///< Of the Hessian.
    bool positive = false;
  };
  /// One step with this δ of J' for all elements.
  Outcome step(double delta);

  /// The smallest J of the cells, and of the elements of the boundary if it slides.
  double least();

  CoupledState state() const { return {coordinates_, boundary_.places()}; }
  void restore(const CoupledState& state);
  /// Puts the nodes a part of the way from `start` to `end`.
  /// @param parts  by node of the mesh
  void put_between(const CoupledState& start, const CoupledState& end, std::span<const double> parts);
  const std::vector<double>& coordinates() const { return coordinates_; }

 private:
  struct LinearSystem;
  double energy(double delta);
  /// @param positive  with a positive semidefinite part of the Hessian only
  void linearise(double delta, bool positive);
  /// The preconditioner: the inverse of each node's block, whose eigenvalues are made positive.
  void invert_blocks();
  /// Sets step_ to what conjugate gradients find.
  ConjugateGradients solve();
  double multiply();
  double precondition();
  double dot(const std::vector<double>& a, const std::vector<double>& b);
  /// The energy at `start` plus alpha times the step.
  double energy_at(double alpha, const CoupledState& start, double delta);

  VolumeEnergy& volume_;
  BoundaryEnergy& boundary_;
  const Team& team_;
  Reduction reduction_;
  std::vector<double> coordinates_;
  std::vector<Eigen::Matrix3d> directions_;  ///< T by rank.
  std::vector<double> gradient_;             ///< In the directions, 3 per rank, as all vectors here.
  std::vector<std::array<double, 6>> blocks_;
  std::vector<Eigen::Matrix3d> inverse_;
  const BoundaryEnergy::Matrix* boundary_hessian_ = nullptr;  ///< As of the last linearise(); null before.
  std::vector<double> step_, residual_, direction_, product_;
  std::vector<float> moves_,
      forces_;  ///< Those of a product: T times the direction, and the volume's Hessian times it.
};

}  // namespace varimesh::detail
