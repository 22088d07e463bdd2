// The energy of a whole mesh and its free nodes, for Newton's method, on the threads of one machine.
#pragma once

#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/preconditioner/preconditioner.h"
#include "core/solvers/minimised.h"
#include "core/terms/cell_energy.h"

namespace varimesh {

/// Minimises CellEnergy over the free nodes of a problem. Gradient, objective and steps are in double precision; the
/// other vectors, products and the preconditioner are in single precision. H and r are divided by powers of two, so
/// that their numbers are of order one for all constants and p-norms. A step that makes a valid cell invalid is not
/// allowed.
///
/// Expects the δ of the cells to be up to date (Sweeper::scan).
///
/// With the part that a rank has of a whole problem, the rank's own free nodes are the unknowns here. All ranks call
/// the functions of Minimised together. They get the same numbers, and each rank gets its own unknowns with the same
/// bits as without ranks. The positions of the part's other nodes follow. The token interrupts all ranks at the same
/// sum.
class MeshObjective final : public Minimised {
 public:
  MeshObjective(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
                const Team& team)
      : MeshObjective(problem, kernels, hessian, norm, team, nullptr) {}
  /// The objective of a rank's part.
  MeshObjective(ProblemPart& part, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
                const Team& team)
      : MeshObjective(part.problem, kernels, hessian, norm, team, &part) {}

  /// Reports assemblies, products and what the kernels do to `meter`, which may be null and must outlive the object.
  /// `point`: the operations of the kernels' energy.
  void count_with(WorkMeter* meter, const PointOperations& point) {
    meter_ = meter;
    energy_.count_with(meter, point, meter);
  }

  double linearise(bool renews) override;
  double precondition() override { return preconditioner_.apply(residual_, product_); }
  double multiply() override;
  void advance(double alpha) override;
  void turn(double beta) override;
  void take_direction() override;
  double gradient_norm() override;
  double preconditioned_norm(double rq) const override;
  double largest_step() override { return largest_displacement<double>(step_) * step_scale_; }
  double largest_correction() override { return largest_displacement<float>(product_) * correction_scale_; }
  double largest_defect() override;
  double finish_step() override;
  double noise() override;
  double move(double alpha) override;
  void go_back() override { place(0, team_.without_stop()); }

  /// By cell: the scans where the nodes are.
  std::span<const CellScan> scans() const { return energy_.scans(); }
  Preconditioner& preconditioner() { return preconditioner_; }

 private:
  MeshObjective(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
                const Team& team, const ProblemPart* part);
  void begin_assembly(std::int64_t work) {
    if (meter_ != nullptr) meter_->begin(Activity::Assembly, work);
  }
  /// Sets residual_ to −gradient_ divided by a power of two, which it sets.
  void scale_residual();
  /// The largest displacement of a node, d numbers per node, in units of the size of the cells around it.
  template <class Number>
  double largest_displacement(std::span<const Number> displacements);
  /// Puts every free node to its start plus alpha times the step.
  void place(double alpha, const Team& team);

  Problem& problem_;
  const HessianKernels& hessian_;
  const Team& team_;
  const ProblemPart* part_;
  std::size_t own_nodes_;  ///< So many at the beginning of Problem::free.
  WholeReduction reduction_;
  WorkMeter* meter_ = nullptr;
  CellEnergy energy_;
  Preconditioner preconditioner_;
  std::size_t unknowns_;
  double gradient_scale_ = 1;                     ///< The residual is divided by this.
  double step_scale_ = 1, correction_scale_ = 1;  ///< step_ and product_ times these are displacements.
  /// d per own free node: the gradient. The line search does not need it and keeps the nodes' first positions here.
  UntouchedVector<double> gradient_;
  UntouchedVector<double> step_;
  UntouchedVector<float> residual_;  ///< d per own free node.
  // d per free node, then padded(d) zeros:
  UntouchedVector<float> direction_;
  UntouchedVector<float> product_;  ///< H direction_, and when that has been used, M⁻¹ residual_.
};

}  // namespace varimesh
