// The energy of untangling: shape at the quadrature points, and a barrier on the Bernstein coefficients of J.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/problem/problem.h"
#include "core/untangle/coefficient_table.h"

namespace varimesh {

/// χ(J) = (s + J)/2 with s = √(J² + ε²): positive for every J, and J itself where J ≫ ε.
double regularised_jacobian(double jacobian, double epsilon);

/// Of one cell, with w the quadrature weights times |det A| over their sum, J = det F, and B_k the Bernstein
/// coefficients of det ∇χ_M over the target's mean measure (so that all are 1 in a cell that is its target):
///
///     E = Σ_q w_q |F|² / (d χ(J)^(2/d)) + θ/2 mean_k (B_k² + 1)/χ(B_k),   θ = 0.5
///
/// E is at least 1 + θ; smaller cells count like larger ones. A cell that cannot be repaired has the first term alone,
/// with ε = 1 there: it keeps a shape and presses on nobody. As ε → 0 the second term grows beyond bounds where a B_k
/// is not positive; where all are, J > 0 in the whole cell.
class CoefficientEnergy {
 public:
  /// Keeps a reference to the set, whose targets must stay as they are.
  explicit CoefficientEnergy(const CellSet& set);

  /// A cell and what is asked of it.
  struct Cell {
    std::int32_t number = 0;    ///< In the set.
    bool unrepairable = false;  ///< Without the barrier.
    std::vector<int> free;      ///< Local numbers of the nodes that may move.
    std::vector<int> movable;   ///< Coefficients that depend on them: those in the barrier. Set by find_movable().
    Eigen::MatrixXd positions;  ///< nodes × d
  };
  void find_movable(Cell& cell) const;

  /// E and its derivatives by the free nodes' components (n · d + c for the n-th of them). The Hessian is positive
  /// semidefinite: J's own second derivatives are left out, and second derivatives of the two functions are kept from
  /// being negative (coefficient_energy.cpp says how).
  struct Expansion {
    double value = 0;
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
  };
  Expansion expand(const Cell& cell, double epsilon) const;

  double value(const Cell& cell, double epsilon) const;

  /// B_k, all of them.
  Eigen::VectorXd coefficients(const Cell& cell) const;

  /// Smallest B_k that a free node moves; +∞ where there is none, and of unrepairable cells.
  double smallest_coefficient(const Cell& cell) const;

 private:
  double shape_value(const Cell& cell, double epsilon) const;
  double barrier_value(const Cell& cell, double epsilon) const;
  void add_shape(const Cell& cell, double epsilon, Expansion& out) const;
  void add_barrier(const Cell& cell, double epsilon, Expansion& out) const;
  /// One over the target's mean measure, with its sign.
  double coefficient_scale(std::int32_t cell) const;

  const CellSet& block_;
  const CoefficientTable& table_;
};

}  // namespace varimesh
