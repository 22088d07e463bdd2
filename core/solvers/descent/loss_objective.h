// The loss of accuracy of a mesh with the energy as its barrier, for Newton's method.
#pragma once

#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/shared_work.h"
#include "core/base/team.h"
#include "core/energy/material.h"
#include "core/problem/problem.h"
#include "core/ranks/whole_reduction.h"
#include "core/solvers/descent/form/modal_form.h"
#include "core/solvers/descent/form/order_levels.h"
#include "core/solvers/minimised.h"
#include "core/terms/cell_energy.h"
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// The sum of a modal form, an energy and what holds vertices, over the free nodes of a problem. All vectors are in
/// double precision, with d numbers per free node; products with the energy's Hessian are in single precision
/// (cell_energy.h). The preconditioner is `levels`, whose diagonals must be up to date. A step that makes a valid cell
/// invalid is not allowed.
///
/// With the part that a rank has of a whole problem, the rank's own free nodes are the unknowns here. All ranks call
/// all functions together. They get the same numbers, and each rank gets its own unknowns with the same bits as without
/// ranks. The positions of the part's other nodes follow.
class LossObjective final : public Minimised {
 public:
  /// All arguments are kept by reference, except for `material`, which is the energy's. `part`: the part whose problem
  /// `problem` is; null: `problem` is a whole problem.
  LossObjective(Problem& problem, CellEnergy& energy, ModalForm& form, OrderLevels& levels, const Material& material,
                const Team& team, const ProblemPart* part = nullptr);

  /// Adds Σ_e 1/N hold_e mean over the vertices v of cell e of |x_v − X_v|². `hold`: by CellSet::first + cell of the
  /// whole problem; `places`: X of the free nodes, which must outlive the object or the next call.
  void hold_vertices(std::span<const double> hold, std::span<const double> places);
  /// By free node: the factor of |x − X|² that follows; 0 if it is no vertex.
  std::span<const double> hold() const { return hold_; }

  /// Call it after the form has taken other frames, or somebody else has moved nodes.
  void forget_form() { has_form_ = false; }
  /// The form at problem.positions. Sets ModalForm::squared_losses().
  double form();

  double linearise(bool renews) override;
  bool make_convex() override;
  double precondition() override;
  double multiply() override;
  void advance(double alpha) override;
  void turn(double beta) override;
  void take_direction() override { shared_copy<double>(direction_, step_, team_); }
  double gradient_norm() override;
  double preconditioned_norm(double rq) const override;
  double largest_step() override { return largest(step_); }
  double largest_correction() override { return largest(product_); }
  double largest_defect() override;
  double finish_step() override;
  double noise() override { return noise_; }
  double move(double alpha) override;
  void go_back() override;

  /// The largest displacement of a node, of d numbers per free node, in units of the size of the cells around it.
  double largest(std::span<const double> displacements) const;
  /// The same of the displacements from these positions of all nodes of the whole problem to problem.positions.
  double largest_from(std::span<const double> positions) const;

 private:
  /// The largest length of displacement(f, k), by free node and direction, in these units.
  template <class Displacement>
  double largest_of(const Displacement& displacement) const;
  /// Adds the gradients of the form and of what holds vertices to gradient_. Sets residual_ = −gradient_.
  void add_form();
  void clear_step();
  /// What holds vertices.
  double held() const;
  /// Moves the own free nodes to position_of(number), by number in start_, and the others follow.
  template <class PositionOf>
  void place(const PositionOf& position_of, const Team& team);

  Problem& problem_;
  CellEnergy& energy_;
  ModalForm& form_;
  OrderLevels& levels_;
  Material material_;
  const Team& team_;
  const ProblemPart* part_;
  std::size_t own_nodes_;  ///< So many at the beginning of Problem::free.
  std::size_t unknowns_;   ///< d for each of them.
  WholeReduction reduction_;
  /// form_value_ is that of problem.positions, and product_ has the form's gradient there.
  bool has_form_ = false;
  bool is_convex_ = false;
  double form_value_ = 0, noise_ = 0;
  UntouchedVector<double> hold_;  ///< By free node: of |x − X|², 0 if it is no vertex.
  std::span<const double> places_;
  UntouchedVector<double> gradient_, start_, step_, residual_, direction_, product_;  ///< d per free node.
  UntouchedVector<float> rough_direction_, rough_product_;  ///< Of products with the energy's Hessian, padded.
};

}  // namespace varimesh
