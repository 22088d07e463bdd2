// Lagrange bases through a node set, evaluated anywhere in the reference cell.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/reference/nodes.h"

namespace varimesh::reference {

/// Values of the Lagrange basis functions: points × nodes, so that values · nodal = interpolated. Evaluated through an
/// orthonormal modal basis (Koornwinder–Dubiner on simplices, Legendre products on tensor cells, the space of Johnen
/// and Geuzaine 2015 on pyramids), which keeps the conversion well conditioned up to order 10.
Eigen::MatrixXd basis_values(Shape shape, int order, NodeSet set, int ambient, const Points& at);

/// Gradients of the Lagrange basis functions with respect to the reference coordinates: one points × nodes matrix a
/// direction. On pyramids `at` must not hold the apex.
std::vector<Eigen::MatrixXd> basis_gradients(Shape shape, int order, NodeSet set, int ambient, const Points& at);

/// Matrix that turns nodal values on `from` into nodal values on `to`, both of order `order`: nodes × nodes.
const Eigen::MatrixXd& conversion(Shape shape, int order, NodeSet from, NodeSet to, int ambient);

/// The uniform lattice with `intervals` intervals an edge, vertices and edges included. On pyramids the apex, where the
/// basis has no gradient, is replaced by five points at z = 1 − 1e-6: one on the axis and one on each of the four
/// edges, since the gradient there depends on the direction.
Points uniform_lattice(Shape shape, int intervals);

}  // namespace varimesh::reference
