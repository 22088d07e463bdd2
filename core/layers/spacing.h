// Where a column through layers has its nodes. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "core/options/options.h"

namespace varimesh::detail {

/// How much layers of these heights grow across one of them: the g of spaced_column().
double growth_across(const std::vector<double>& heights, std::size_t cell);

/// The share of a cell's height that lies below the share ξ of its nodes if they are graded: (1 − w) ξ + w t, as
/// spaced_column() says.
///
/// @param growth  g
/// @param height  h, in the unit of `size`
double graded_share(double xi, double growth, double height, double size, int order);

/// The nodes of a column, moved along it to the spacing that is wanted. Vertices stay.
///
/// Even: the nodes of a cell are at equal distances. Graded: they follow the growth g of the layers. At the share ξ of
/// the nodes between two vertices, the share of the distance is t = (g^αξ − 1)/(g^α − 1), with g² the ratio of the
/// heights above and below the cell, or g the ratio to its only neighbour, and α = .6. With α = 1 and a geometric
/// progression of heights, t would be the same smooth function through all layers, in which exp(−n/δ) is nearly a
/// polynomial; with .6 other solutions gain too. The nodes go to (1 − w) e + w t, with the even spacing e = ξ and
/// w = 1/(1 + (h/h₀)⁴), which fades where a cell of height h is no longer thin: h₀ = 1.3 times `size`, or 1.2 times at
/// order 3 and .9 times at order 2.
///
/// @param points  of the column, P per cell and one more, lowest first; those above the last whole cell stay
/// @param cells   how many of its cells are whole
/// @param order   P
/// @param size    the shortest edge of the wall at the foot of the column, in the mesh's unit of length
std::vector<Eigen::Vector3d> spaced_column(const std::vector<Eigen::Vector3d>& points, int cells, int order,
                                           double size, LayerSpacing spacing);

}  // namespace varimesh::detail
