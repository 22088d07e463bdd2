// How the nodes inside a face or cell follow those around it. Internal to core/curve.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// The nodes inside an element, and how far each follows the nodes of the edges and faces around.
struct InnerBlend {
  std::vector<int> inner;   ///< Local numbers of the nodes inside.
  Eigen::MatrixXd weights;  ///< inner × nodes of the element. Columns of vertices and of inner nodes are zero.
};

/// The displacement inside, blended from the displacements of the nodes around, if the vertices stay:
///   triangle, tetrahedron  core/mesh/changes/simplex_blend.h
///   quadrilateral  the linear blend between opposite edges, for both pairs
///   prism          the linear blend between the two triangles
///   hexahedron     the blend between opposite faces minus that between edges
/// W. J. Gordon, C. A. Hall, Construction of curvilinear co-ordinate systems, Int. J. Numer. Meth. Eng. 7, 1973. The
/// inner nodes of a pyramid stay, and the weights are zero.
const InnerBlend& inner_blend(Shape shape, int order);

/// Moves the inner nodes of one element by the blended displacement of its other nodes.
/// @param nodes     indices of all its nodes in Gmsh's order
/// @param straight  coordinates of all nodes of the mesh with straight sides
void move_inner(const InnerBlend& inner, const std::int32_t* nodes, const std::vector<double>& straight,
                std::vector<double>& coordinates);

}  // namespace varimesh::detail
