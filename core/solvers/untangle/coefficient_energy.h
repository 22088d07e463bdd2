// The energy of untangling: a shape term at the quadrature points, and a barrier on the Bernstein coefficients of J.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/problem/problem.h"
#include "core/solvers/untangle/coefficient_table.h"

namespace varimesh {

/// χ(J) = (s + J)/2 with s = √(J² + ε²): positive for every J, and nearly J if J ≫ ε.
double regularised_jacobian(double jacobian, double epsilon);

/// The energy of one cell:
///
///     E = Σ_q w_q |F|² / (d χ(J)^(2/d)) + θ/2 mean_k (B_k² + 1)/χ(B_k),   θ = 0.5
///
/// w are the quadrature weights times |det A|, divided by their sum; J = det F; B_k are the Bernstein coefficients of
/// det ∇χ_M divided by the mean measure of the target, so all are 1 in a cell that is its target. E is at least 1 + θ.
/// Small cells count as much as large ones. An unrepairable cell has only the first term, with ε = 1: it keeps a shape
/// and does not press on its neighbours. As ε → 0 the second term grows without bound unless all B_k are positive; if
/// they are, J > 0 in the whole cell.
class CoefficientEnergy {
 public:
  /// Keeps a reference to the set, whose targets must not change.
  explicit CoefficientEnergy(const CellSet& set);

  /// A cell, and which of its nodes may move.
  struct Cell {
    std::int32_t number = 0;    ///< In the set.
    bool unrepairable = false;  ///< If so, it has no barrier.
    std::vector<int> free;      ///< Local numbers of the nodes that may move.
    std::vector<int> movable;   ///< Coefficients that depend on them, those in the barrier. Set by find_movable().
    Eigen::MatrixXd positions;  ///< nodes × d
  };
  void find_movable(Cell& cell, const StopToken* stop = nullptr) const;

  /// E and its derivatives by the components of the free nodes (n · d + c for component c of the n-th free node). The
  /// Hessian is positive semidefinite: it leaves out the second derivatives of J, and the second derivatives of the two
  /// functions are kept from being negative (coefficient_energy.cpp says how). It looks at the token, which may be
  /// null.
  struct Expansion {
    double value = 0;
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
  };
  Expansion expand(const Cell& cell, double epsilon, const StopToken* stop = nullptr) const;

  double value(const Cell& cell, double epsilon) const;

  /// All B_k.
  Eigen::VectorXd coefficients(const Cell& cell) const;

  /// The smallest B_k that depends on a free node; +∞ if there is none or if the cell is unrepairable.
  double smallest_coefficient(const Cell& cell) const;

 private:
  double shape_value(const Cell& cell, double epsilon) const;
  template <int d>
  double shape_value_in(const Cell& cell, double epsilon) const;
  double barrier_value(const Cell& cell, double epsilon) const;
  void add_shape(const Cell& cell, double epsilon, const StopToken* stop, Expansion& out) const;
  template <int d>
  void add_shape_in(const Cell& cell, double epsilon, const StopToken* stop, Expansion& out) const;
  void add_barrier(const Cell& cell, double epsilon, const StopToken* stop, Expansion& out) const;
  /// 1 over the mean measure of the target, with the sign of det A.
  double coefficient_scale(std::int32_t cell) const;

  const CellSet& set_;
  const CoefficientTable& table_;
  Eigen::MatrixXd gradients_;  ///< nodes × (points · d): ∂φ_n/∂ξ_k at point q in column q d + k.
};

}  // namespace varimesh
