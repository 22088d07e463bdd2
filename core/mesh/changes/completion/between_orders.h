// What elements of one order have in common with elements of another. Internal to the library.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {

/// The values of the functions of an element at some points: points × nodes of the element. An element with fewer nodes
/// than complete ones is a serendipity element.
Eigen::MatrixXd values_at(Shape shape, int order, std::size_t nodes, const reference::Points& at, int ambient);

/// For each node of the complete element of order `to`, the node of the element of order `from` that has the same
/// place, or −1.
std::vector<int> same_nodes(Shape shape, int from, std::size_t from_nodes, int to);

/// Gives numbers to the nodes from `first` on, which have none, and puts them in the order of their entities.
/// @param entities  of these nodes, as (dimension, tag)
/// @return where each of them is now; elements still have the old place
std::vector<std::int32_t> number_new_nodes(HighOrderMesh& mesh, std::size_t first,
                                           std::vector<std::pair<int, int>> entities);

}  // namespace varimesh::detail
