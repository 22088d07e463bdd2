// Orthonormal modal bases on the reference cells, with exact gradients.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/reference/nodes.h"

namespace varimesh::reference {

/// Values of the orthonormal modal basis: points × modes.
Eigen::MatrixXd modal_values(Shape shape, int order, const Points& at);

/// Gradients of the orthonormal modal basis: one points × modes matrix per direction. On pyramids `at` must not contain
/// the apex.
std::vector<Eigen::MatrixXd> modal_gradients(Shape shape, int order, const Points& at);

/// The degree of each mode: the least order of a cell of this shape whose modal basis has the mode. The modes of degree
/// up to s are therefore an orthonormal basis of the maps of cells of order s, and those of degree up to 1 of the maps
/// of straight-sided cells. On simplices it is the total degree, on quadrilaterals and hexahedra the largest degree in
/// one direction.
std::vector<int> modal_degrees(Shape shape, int order);

}  // namespace varimesh::reference
