// Newton's method: all free nodes move at once. Truncated Newton steps with matrix-free conjugate gradients.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/conjugate_gradients.h"
#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/kernels/hessian/batches.h"
#include "core/kernels/hessian/operations.h"
#include "core/kernels/kernels.h"
#include "core/kernels/p_norm.h"
#include "core/preconditioner/preconditioner.h"
#include "core/preconditioner/reduction.h"
#include "core/problem/problem.h"
#include "core/progress/work_meter.h"
#include "core/solvers/newton/ritz_values.h"

namespace varimesh {

/// What one Newton step did. Displacements are in units of the size of the cells around the node (sizes.h).
struct NewtonOutcome {
  double residual = 0;       ///< Largest displacement of a node in the full step, before the line search.
  double gradient_norm = 0;  ///< √ Σ |G|² at the start of the step.
  double damping = 0;        ///< Share of the full step that was taken; 0: no step lowered the energy.
  bool failed = false;       ///< The step is not finite, or it is 0 although the gradient is not.
  /// Whether every node is within the tolerance of the optimum: the residual is, the linear system was solved far
  /// enough, and the gradient after the step agrees.
  bool converged = false;
  LinearSolve linear_solve = LinearSolve::None;
  int products = 0;  ///< Products of the Hessian and a direction.
};

/// Newton steps on a problem. Gradient, energy and steps are in double precision (each cell's contribution to the
/// gradient has 48 bits); directions, products and the preconditioner are in single precision. Products use the full
/// Hessian at deformation gradients that are held to 16 bits (BatchSet::deformation). If conjugate gradients meet a
/// direction of negative curvature, they stop with the step that they have. The line search never makes a valid cell
/// invalid, and raises the energy by no more than rounding.
///
/// Works from the positions of the nodes: it computes deformation gradients a batch of cells at a time and does not
/// hold them. Expects the δ of the cells to be up to date (Sweeper::scan).
class Newton {
 public:
  /// Of the Hessian and a direction, per step. Usual steps need 5 to 60, and 400 at λ = 640. If a step needs more than
  /// this, the preconditioner does not fit the energy.
  static constexpr int kMostProducts = 1000;

  /// `tolerance`: the residual at which the run will end. Steps are solved as tightly as is useful to get there.
  Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm, double tolerance,
         const Team& team);

  /// From now on a linear system is solved only to a tenth of its initial residual, with at most this many products.
  void solve_roughly(int most_products) {
    rough_ = true;
    most_products_ = most_products;
  }

  /// From now on counts assemblies and products, and what the kernels do, with this meter, which must outlive the
  /// object; null: with none. `point`: the operations of the kernels' energy.
  void count_with(WorkMeter* meter, const PointOperations& point) {
    meter_ = meter;
    operations_ = mesh_operations(batches_, point);
  }

  /// If the team's token interrupts it, the nodes are where they were before, or where the step has put them.
  NewtonOutcome step();

  /// By cell: the scans after the step, with the δ from before it.
  std::span<const CellScan> scans() const { return scans_; }

  /// Reads or writes what a step leaves for the next.
  template <class Archive>
  void state(Archive& archive) {
    archive(last_gradient_, coarse_is_old_, products_when_new_);
    spectrum_.state(archive);
    preconditioner_.state(archive, !coarse_is_old_);
  }

 private:
  // === Linearisation (linearisation.cpp) ===
  /// From the positions of the nodes, sets gradient_ and what products and the preconditioner need.
  void linearise();
  /// Tells the meter that an assembly begins: a gradient, and with `whole` all that linearise() does.
  void begin_assembly(bool whole);
  void count(std::int64_t work) const {
    if (meter_ != nullptr) meter_->add(work);
  }
  /// Tells the meter what the kernels have done in a loop that all threads have shared since the stopwatch started.
  void count_kernels(double operations, const Stopwatch& watch) const {
    if (meter_ != nullptr) meter_->add_kernels({operations, watch.seconds() * team_.threads()});
  }
  /// Sets hessian_scale_ so that the Hessian fits single precision. That of the p-norm is estimated as that of the
  /// energy times the largest slope of a cell.
  void scale_hessian();
  /// The largest absolute entry of a free node's own block of the energy's Hessian.
  double largest_entry(std::int32_t rank);
  void linearise_batch(std::size_t set, std::int32_t batch);
  /// Sets gradient_ and the cells' contributions from the positions of the nodes.
  void find_gradient();
  /// Only for the p-norm: keeps the cells' gradients, for the term with its curvature.
  void keep_cell_gradients(std::size_t set, std::int32_t batch);
  /// The gradient of a free node, and its own block of the Hessian (lower triangle by rows), from its cells'
  /// contributions.
  void add_up_gradient(std::int32_t rank);
  std::array<double, 6> added_up_block(std::int32_t rank) const;

  // === The linear system ===
  struct LinearSystem;
  /// Only for the p-norm: adds g (g · direction) of each cell of the batch to its contributions.
  void add_norm_term(std::size_t set, std::int32_t batch);
  /// product_ = H direction_; returns direction_ · product_.
  double multiply();
  /// Sets residual_ to −gradient_ divided by a power of two, which it returns: numbers in single precision are then of
  /// order one for all constants and p-norms.
  double scale_residual();
  /// Solves H x = −G with conjugate gradients, up to the forcing term or as the tolerance requires. x times `scale` is
  /// the displacement. `initial`: G · M⁻¹ G.
  void solve(double initial, double forcing, double scale, NewtonOutcome& outcome);
  /// Whether conjugate gradients may stop. `share`: of the initial residual, what is left.
  bool is_solved(double share, double forcing, double scale);
  /// The largest displacement of a node, d numbers per node, in units of the size of the cells around it.
  template <class Number>
  double largest_displacement(const std::vector<Number>& displacements);
  /// An estimate of how far a node is from the solution of the linear system, in units of the size of the cells around
  /// it, from M⁻¹ r in product_; +∞ if the spectrum is not known yet. `step`: the residual of the step.
  ///
  /// Two bounds hold in the norm of M, and the smaller one is taken for the node that is farthest away: M⁻¹ r divided
  /// by the smallest eigenvalue of M⁻¹H, and what conjugate gradients must have reduced the error to after this many
  /// products.
  double distance_left(double step, double scale);
  /// How far a node is from the optimum because the linear residual and the gradient differ: the residual is carried
  /// along in single precision, and the energy is not quadratic. `gradient_scale`: that of residual_. Overwrites the
  /// vectors of conjugate gradients.
  double defect(double gradient_scale);

  // === The line search ===
  /// Moves the nodes by a share of the step and returns the share; 0: no step was accepted.
  double search(double slope);
  /// Puts every free node to `start` plus alpha times the step.
  void place(double alpha, const std::vector<double>& start, const Team& team);
  /// The energy with every free node displaced from `start` by alpha times the step; +∞ if that makes a valid cell
  /// invalid.
  double energy_at(double alpha, const std::vector<double>& start);
  /// Scans every cell, from the positions of the nodes.
  void scan_all();
  /// Σ slope V over the cells, the factor of rounding errors in their densities.
  double rounding();
  /// The energy of the last scans; +∞ if a valid cell has become invalid.
  double scanned_energy();

  Problem& problem_;
  const Kernels& kernels_;
  const HessianKernels& hessian_;
  PNorm norm_;
  double tolerance_;
  const Team& team_;
  WorkMeter* meter_ = nullptr;
  MeshOperations operations_;
  Reduction reduction_;
  std::vector<BatchSet> batches_;
  Preconditioner preconditioner_;
  /// By set, as BatchSet::contributions of width d: √curvature g. Only for p ≠ 1.
  std::vector<AlignedVector<float>> cell_gradients_;
  double hessian_scale_ = 1;  ///< The Hessian is divided by this in products and blocks.
  std::size_t unknowns_ = 0;
  double last_gradient_ = 0;   ///< Gradient of the step before, in the preconditioner's norm.
  RitzValues ritz_;            ///< Of the last solve.
  SpectrumEstimate spectrum_;  ///< Of M⁻¹H.
  /// d per free node: the gradient. The line search does not need it and keeps the nodes' first positions here.
  std::vector<double> gradient_;
  std::vector<double> step_;
  std::vector<float> residual_;  ///< d per free node.
  // d per free node, then padded(d) zeros:
  std::vector<float> direction_;
  std::vector<float> product_;         ///< H direction_, and when that has been used, M⁻¹ residual_.
  std::vector<CellScan> scans_;        ///< By cell.
  bool coarse_is_old_ = true;          ///< The coarse level has to be assembled again.
  bool rough_ = false;                 ///< See solve_roughly().
  int most_products_ = kMostProducts;  ///< Per Newton step.
  int products_when_new_ = 0;          ///< Products of the first step with the present coarse level.
};

}  // namespace varimesh
