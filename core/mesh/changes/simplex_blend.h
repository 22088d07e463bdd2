// How nodes on the faces and inside a simplex follow its edges and faces. Internal to the library.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh::detail {

/// The edges, faces and inner nodes of one shape and order, and how deviations from the straight-sided simplex blend.
///
/// With barycentric coordinates λ, an edge (a, b) that deviates by e(t) contributes λ_a λ_b / (t (1 − t)) e(t) with
/// t = (1 + λ_b − λ_a)/2. In a tetrahedron, a face that deviates by f(μ) beyond what its edges contribute adds
/// λ_a λ_b λ_c / (μ_a μ_b μ_c) f(μ) with μ = λ + λ_d/3. All contributions vanish on the other edges and faces.
struct SimplexBlend {
  std::vector<std::vector<int>> edges;   ///< By edge: its inner nodes.
  std::vector<std::vector<int>> faces;   ///< By face: its inner nodes. A triangle is its own only face.
  std::vector<int> inside;               ///< The inner nodes of a tetrahedron; empty for a triangle.
  std::vector<Eigen::MatrixXd> on_face;  ///< By face: inner nodes × all nodes; zero except for nodes of its edges.
  Eigen::MatrixXd in_cell;               ///< inside × all nodes; zero except for nodes of edges and faces.
  Eigen::MatrixXd linear;                ///< All nodes × vertices: gives the straight-sided positions.
};

/// For triangles and tetrahedra. It is made once and kept until the program ends.
const SimplexBlend& simplex_blend(Shape shape, int order);

}  // namespace varimesh::detail
