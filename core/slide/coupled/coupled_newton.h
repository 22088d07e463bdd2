// All nodes of a mesh together, those on its boundary included, for Newton's method. Internal to core/slide.
#pragma once

#include <span>
#include <vector>

#include "core/slide/coupled/boundary_energy.h"
#include "core/slide/coupled/volume_energy.h"
#include "core/solvers/newton_method.h"

namespace varimesh::detail {

/// Where all nodes of the mesh are.
struct CoupledState {
  std::vector<double> coordinates;  ///< 3 per node of the mesh.
  BoundaryEnergy::Places places;
};

/// Minimises E(volume) + w E(boundary) (volume_energy.h, boundary_energy.h).
///
/// A step solves for x += T q of all nodes, with T a basis of the tangents of nodes that slide and the identity for
/// nodes inside the mesh, by conjugate gradients on the Hessian TᵀHT plus the curvature of the entities. Its convex
/// part has no curvature of the entities. The preconditioner is each node's own block, whose eigenvalues are made
/// positive.
class CoupledNewton final : private Minimised {
 public:
  /// Both must outlive the object. boundary.prepare() has been called.
  CoupledNewton(VolumeEnergy& volume, BoundaryEnergy& boundary, std::vector<double> coordinates, const Team& team);

  double boundary_weight = 1;   ///< w.
  bool boundary_slides = true;  ///< Otherwise only the nodes inside the mesh move.

  /// One step with this δ of J' for all elements.
  NewtonOutcome step(double delta);

  /// The smallest J of the cells, and of the elements of the boundary if it slides.
  double least();

  CoupledState state() const { return {coordinates_, boundary_.places()}; }
  void restore(const CoupledState& state);
  /// Puts the nodes a part of the way from `start` to `end`.
  /// @param parts  by node of the mesh
  void put_between(const CoupledState& start, const CoupledState& end, std::span<const double> parts);
  const std::vector<double>& coordinates() const { return coordinates_; }

 private:
  double linearise(bool renews) override;
  bool make_convex() override;
  double precondition() override;
  double multiply() override;
  void advance(double alpha) override;
  void turn(double beta) override;
  void take_direction() override { step_ = direction_; }
  double gradient_norm() override;
  double preconditioned_norm(double rq) const override;
  double largest_step() override;
  double finish_step() override;
  double noise() override { return 1e-14 * std::abs(before_); }
  double move(double alpha) override;
  void settle() override;

  double energy();
  /// Prepares the linear system from gradient_ and what the energies have linearised.
  void begin_system();
  void invert_block(std::int32_t rank, const std::array<double, 6>& of_volume);
  double dot(const std::vector<double>& a, const std::vector<double>& b);

  VolumeEnergy& volume_;
  BoundaryEnergy& boundary_;
  const Team& team_;
  Reduction reduction_;
  std::vector<double> coordinates_;
  double delta_ = 0, before_ = 0;
  CoupledState start_;                       ///< Where linearise() found the nodes, once the step is finished.
  std::vector<Eigen::Matrix3d> directions_;  ///< T by rank.
  std::vector<double> gradient_;             ///< In the directions, 3 per rank, as all vectors here.
  std::vector<Eigen::Matrix3d> inverse_;
  const BoundaryEnergy::Matrix* boundary_hessian_ = nullptr;  ///< As of the last linearise(); null before.
  std::vector<double> step_, residual_, direction_, product_;
  std::vector<float> moves_,
      forces_;  ///< Those of a product: T times the direction, and the volume's Hessian times it.
};

}  // namespace varimesh::detail
