// All free nodes at once: truncated Newton with matrix-free conjugate gradients.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/hessian/batches.h"
#include "core/kernels/kernels.h"
#include "core/kernels/p_norm.h"
#include "core/newton/preconditioner.h"
#include "core/problem/problem.h"

namespace varimesh {

/// What one Newton step did. Lengths are relative to the diagonal of the bounding box.
struct NewtonOutcome {
  double residual = 0;       ///< Largest displacement of a node in the full step, before the line search.
  double gradient_norm = 0;  ///< √ Σ |G|² at the start of the step.
  double damping = 0;        ///< The share of the full step that was taken; 0: none lowered the energy.
  bool failed = false;       ///< The step is not a number, or there is none although the gradient is not 0.
  bool cut_short = false;    ///< By negative curvature: the full step, and so the residual, is not known.
  int products = 0;          ///< Of the Hessian and a direction.
};

/// Newton steps on a problem: gradient, energy and steps in double precision (the gradient to 48 bits of a cell's
/// part), directions, products and the preconditioner in single. The products' Hessian is exact; where conjugate
/// gradients meet a direction of negative curvature they stop with what they have. The line search never raises the
/// energy and never makes a valid cell invalid.
///
/// Goes by the nodes' positions: deformation gradients are computed where they are needed, a batch of cells at a time,
/// and kept by nobody. Expects the cells' δ to be up to date (Sweeper::scan).
class Newton {
 public:
  /// `tolerance`: the residual at which the run will end; steps are solved as tightly as helps to get there.
  Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm, double tolerance,
         const Team& team);

  NewtonOutcome step();

  /// By cell: what the deformation gradients say after the step, with the δ that there was before it.
  std::span<const CellScan> scans() const { return scans_; }

  /// What a step leaves for the next.
  template <class Archive>
  void state(Archive& archive) {
    archive(last_gradient_, coarse_is_old_, products_when_new_);
    preconditioner_.coarse().state(archive, !coarse_is_old_);
  }

 private:
  /// Σ term(i), or the largest term(i) or 0, for i < count: in tasks of `grain`, so that the sum depends on nothing
  /// else.
  template <class Term, class Combine>
  double reduce(std::size_t count, std::size_t grain, const Term& term, const Combine& combine);
  template <class Term>
  double add_up(std::size_t count, std::size_t grain, const Term& term);
  template <class Term>
  double largest_of(std::size_t count, std::size_t grain, const Term& term);
  /// Sets gradient_ and what products and the preconditioner need, from the nodes' positions.
  void linearise();
  /// Finds out how large the Hessian is, so that it fits single precision. The p-norm's is taken to be the energy's
  /// times the largest slope of a cell.
  void scale_hessian();
  /// Of a free node's own block of the energy's Hessian, by size.
  double largest_entry(std::int32_t rank);
  void linearise_batch(std::size_t set, std::int32_t batch);
  /// The p-norm's part of it: each cell's gradient, for its curvature.
  void keep_cell_gradients(std::size_t set, std::int32_t batch);
  /// Of a free node, from its cells' parts.
  void add_up_gradient(std::int32_t rank);
  std::array<double, 6> added_up_block(std::int32_t rank) const;
  /// Adds g (g · direction) of each cell of the batch to its result.
  void add_norm_part(std::size_t set, std::int32_t batch);
  /// product_ = H direction_; returns direction_ · product_.
  double multiply();
  /// Solves H x = −G to the forcing term, or to what the tolerance asks for. `scale` makes a displacement of x;
  /// `first`: G · M⁻¹ G.
  void conjugate_gradients(double first, double forcing, double scale, NewtonOutcome& outcome);
  /// Whether a step may end that conjugate gradients have solved to this share of its beginning.
  bool is_solved(double share, double forcing, double scale);
  /// Of a node in the step, in the step's scale.
  double largest_displacement();
  double search(double slope);
  /// Energy with every free node displaced from `start` by alpha times the step; +∞ where that makes a valid cell
  /// invalid.
  double energy_at(double alpha, const std::vector<double>& start);
  /// Deformation gradients of every cell, looked at and forgotten.
  void scan_all();
  /// Σ slope V over the cells: what rounding in their densities is multiplied with.
  double rounding();
  /// The energy of the last scans, likewise.
  double scanned_energy();

  Problem& problem_;
  const Kernels& kernels_;
  const HessianKernels& hessian_;
  PNorm norm_;
  double tolerance_;
  const Team& team_;
  std::vector<BatchSet> batches_;
  Preconditioner preconditioner_;
  std::vector<AlignedVector<float>> cell_gradients_;  ///< √curvature g by set, as its parts, d wide; p ≠ 1 only.
  double hessian_scale_ = 1;                          ///< What the Hessian is divided by in products and blocks.
  std::size_t unknowns_ = 0;
  double last_gradient_ = 0;  ///< In the preconditioner's norm, of the step before.
  /// d a free node: the gradient, and during the line search, which has no use for it, where the nodes were.
  std::vector<double> gradient_;
  std::vector<double> step_;
  std::vector<float> residual_;  ///< d a free node.
  // d a free node and padded(d) more, which are 0:
  std::vector<float> direction_;
  std::vector<float> product_;   ///< H direction_, and when that has been used, M⁻¹ residual_.
  std::vector<double> partial_;  ///< Of add_up and largest_of, a task's.
  std::vector<CellScan> scans_;  ///< By cell.
  bool coarse_is_old_ = true;    ///< The coarse level is to be assembled again.
  int products_when_new_ = 0;    ///< Of the step after it was.
};

}  // namespace varimesh
