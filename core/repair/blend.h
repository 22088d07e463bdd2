// What the edges and faces of a simplex say about its inside. Internal to core/repair.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh::detail {

/// Edges, faces and inner nodes of one shape and order, and the blending of deviations from the straight-sided simplex.
///
/// With barycentric coordinates λ, an edge (a, b) whose deviation is e(t) gives λ_a λ_b / (t (1 − t)) e(t) with
/// t = (1 + λ_b − λ_a)/2, and in a tetrahedron a face whose deviation beyond its edges' is f(μ) gives
/// λ_a λ_b λ_c / (μ_a μ_b μ_c) f(μ) with μ = λ + λ_d/3. All vanish on the other edges and faces.
struct Blend {
  std::vector<std::vector<int>> edges;   ///< By edge: its inner nodes.
  std::vector<std::vector<int>> faces;   ///< By face: its inner nodes. Of a triangle the one face is itself.
  std::vector<int> inside;               ///< Of a tetrahedron.
  std::vector<Eigen::MatrixXd> on_face;  ///< By face: inner nodes × all nodes, zero but for nodes of its edges.
  Eigen::MatrixXd in_cell;               ///< inside × all nodes, zero but for nodes of edges and faces.
  Eigen::MatrixXd linear;                ///< All nodes × vertices: the straight-sided place.
};

/// Of triangles and tetrahedra; made once, kept for ever.
const Blend& blend(Shape shape, int order);

}  // namespace varimesh::detail
