// Lagrange bases on a node set, evaluated at any points of the reference cell.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/reference/nodes.h"

namespace varimesh::reference {

/// Values of the Lagrange basis functions, points × nodes: their product with nodal values gives the interpolated
/// values. They are computed through an orthonormal modal basis, which keeps the conversion well conditioned up to
/// order 10: Koornwinder–Dubiner on simplices, Legendre products on tensor cells, the space of Johnen and Geuzaine 2015
/// on pyramids.
/// @param ambient the dimension of the mesh, 2 or 3, as in nodes()
Eigen::MatrixXd basis_values(Shape shape, int order, NodeSet set, int ambient, const Points& at);

/// Gradients of the Lagrange basis functions with respect to the reference coordinates: one points × nodes matrix per
/// direction. On pyramids `at` must not contain the apex.
std::vector<Eigen::MatrixXd> basis_gradients(Shape shape, int order, NodeSet set, int ambient, const Points& at);

/// The Lagrange basis at many points, evaluated a range of points at a time. All gradients of a hexahedron of order 10
/// on a lattice of 23³ points would take 389 MB; the bases of its factors, which are kept, take 6 MB.
class BasisAtPoints {
 public:
  /// The arguments are those of basis_values().
  BasisAtPoints(Shape shape, int order, NodeSet set, int ambient, Points at);

  const Points& points() const { return points_; }
  /// Values at the points `first` to `first` + `count` − 1: count × nodes.
  Eigen::MatrixXd values(Eigen::Index first, Eigen::Index count) const;
  /// Gradients there: one count × nodes matrix per direction.
  std::vector<Eigen::MatrixXd> gradients(Eigen::Index first, Eigen::Index count) const;

 private:
  /// Values and derivatives of the Lagrange basis of one factor, at the points' coordinates in this factor.
  struct FactorBasis {
    Eigen::MatrixXd values;
    std::vector<Eigen::MatrixXd> gradients;
  };
  static std::vector<FactorBasis> evaluate_factors(Shape shape, int order, NodeSet set, int ambient, const Points& at);
  Eigen::MatrixXd multiply(const std::vector<const Eigen::MatrixXd*>& of_factors, Eigen::Index first,
                           Eigen::Index count) const;

  Shape shape_;
  int order_;
  NodeSet set_;
  int ambient_;
  Points points_;
  std::vector<FactorBasis> factors_;  ///< Empty if the shape is not a product.
};

/// The matrix, nodes × nodes, that converts nodal values on `from` to nodal values on `to`, both of order `order`.
const Eigen::MatrixXd& conversion(Shape shape, int order, NodeSet from, NodeSet to, int ambient);

/// The uniform lattice with `intervals` intervals per edge, including vertices and edges. The basis of a pyramid has no
/// gradient at the apex, because it depends on the direction of approach. Five points at z = 1 − 1e-6 therefore replace
/// the apex: one on the axis and one on each of the four edges.
Points uniform_lattice(Shape shape, int intervals);

}  // namespace varimesh::reference
