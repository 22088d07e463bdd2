// The energy of the elements on one curve (d = 1) or surface (d = 2) of a geometry. Internal to core/slide.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "core/energy/material.h"
#include "core/slide/entity_elements.h"

namespace varimesh::detail {

/// The elements of one entity, which are all of one order, with their targets.
///
/// Let G = ∂x/∂ξ (3 × d) be the derivative of an element's map, and R (d × d) the triangular factor of the same
/// derivative of its straight-sided form, at the coordinates as they came. So
///
///     F = G R⁻¹  (3 × d),      E = Σ_e |e| Σ_q w_q W(|F|², J),
///     J = N · (f₁ × f₂)  on a surface,      J = N · f₁  on a curve,
///
/// where f_k are the columns of F, |e| is the straight-sided element's area or length, and W is the hyperelastic
/// density of dimension d. N is the unit normal of the surface, or the unit tangent of the curve, interpolated from the
/// nodes and held fixed while the nodes move by one step. So an element that is folded over has J < 0. A quadrilateral
/// whose straight-sided form is tangled has the square on the mean of its edges in its place.
template <int d>
class EntityEnergy {
 public:
  using Vectors = Eigen::Matrix<double, 3, Eigen::Dynamic>;

  /// @param coordinates of all nodes of the mesh as they came
  EntityEnergy(const std::vector<EntityElement>& elements, int order, const std::vector<double>& coordinates);

  std::size_t size() const { return tables_.size(); }

  /// Leaves the points of an element out of the energy at which no free node changes F. These are all points of an
  /// element without free nodes, and each vertex between two edges on which all nodes are held. Their part of the
  /// energy has no gradient, so the minimum stays where it is. If J ≤ 0 at such a point, no movement unfolds the
  /// element.
  /// @param free  by node of the element
  void leave_out_constant_points(std::size_t element, const std::vector<bool>& free);

  /// What the energy of one element is made of, at its nodes' positions.
  struct Value {
    double energy = 0;  ///< Infinite if J ≤ 0 at a point and δ = 0. Points that were left out add nothing.
    double least = 0;   ///< The smallest J of all its points.
    /// The smallest J of the points that were not left out; infinite if all were.
    double least_movable = std::numeric_limits<double>::infinity();
  };
  /// @param x       positions of the element's nodes
  /// @param normal  unit normals (tangents) at the nodes
  /// @param delta   δ of J' = (J + √(J² + δ²))/2
  Value value(std::size_t element, const Vectors& x, const Vectors& normal, double delta) const;

  /// The gradient (3 per node) and a positive semidefinite part of the Hessian (3 × 3 per pair of nodes): the terms
  /// with f_J ∂²J are left out, and f_JJ counts only if it is positive.
  void derivatives(std::size_t element, const Vectors& x, const Vectors& normal, double delta,
                   Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) const;

  /// |e|.
  double measure(std::size_t element) const { return measure_[element]; }

  /// Length of the shortest straight edge of an element over the order.
  double spacing(std::size_t element) const { return spacing_[element]; }

 private:
  struct Points;
  struct Terms;
  Points points(std::size_t element, const Vectors& x, const Vectors& normal) const;
  Terms terms(std::size_t element, const Points& all, double delta) const;
  bool has_no_target(std::size_t element, Eigen::Index point) const {
    return inverse_[element][static_cast<std::size_t>(point)].isZero(0);
  }
  bool is_constant(std::size_t element, Eigen::Index point) const {
    return !constant_[element].empty() && constant_[element][static_cast<std::size_t>(point)];
  }
  double weight(std::size_t element, Eigen::Index point) const {
    return measure_[element] * tables_[element]->weights[point];
  }

  Material material_;
  std::vector<const EntityTable*> tables_;                         ///< By element.
  std::vector<std::vector<Eigen::Matrix<double, d, d>>> inverse_;  ///< By element and point: R⁻¹; zero: no target.
  std::vector<std::vector<bool>> constant_;                        ///< By element and point; empty: none is.
  std::vector<double> measure_;                                    ///< By element: |e|.
  std::vector<double> spacing_;
};

extern template class EntityEnergy<1>;
extern template class EntityEnergy<2>;

}  // namespace varimesh::detail
