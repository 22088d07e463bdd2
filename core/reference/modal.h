// Orthonormal modal bases on the reference cells, with exact gradients.
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/reference/nodes.h"

namespace varimesh::reference {

/// Values of the orthonormal modal basis: points × modes.
Eigen::MatrixXd modal_values(Shape shape, int order, const Points& at);

/// Gradients of the orthonormal modal basis: one points × modes matrix per direction. On pyramids `at` must not contain
/// the apex.
std::vector<Eigen::MatrixXd> modal_gradients(Shape shape, int order, const Points& at);

}  // namespace varimesh::reference
