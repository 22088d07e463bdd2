// Thin elements follow a curved boundary layer by layer and keep their heights. Internal to core/curve.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/curve/parts.h"

namespace varimesh::detail {

/// An element is thin in a direction if its edges along it are shorter than this times those across it.
inline constexpr double kThin = 0.5;

/// The edge on the other side of a thin quadrilateral, or the other long edge of a thin triangle.
struct EdgeStep {
  std::int32_t from = 0, to = 0;                   ///< Edges.
  std::vector<std::int32_t> nodes_from, nodes_to;  ///< Inner nodes that are opposite each other.
  std::int32_t face = 0;                           ///< Across which it leads.
  /// Across a triangle: the vertex that both edges have, from which their nodes are listed; otherwise −1.
  std::int32_t shared = -1;
};

/// Walks from edges across thin quadrilaterals, each edge once and the nearest first, and calls arrive() for each step
/// to an edge that may move. If it walks across triangles too, it goes from one long edge of a thin one to the other,
/// so two steps lead across a quadrilateral that was cut in two.
/// @param start     edges from which to walk, in this order
/// @param straight  coordinates of all nodes with straight sides
/// @param through   whether to walk across a face
/// @param may_move  whether an edge may be moved; it is called once per edge at most
void walk_edges(const MeshParts& parts, int order, const std::vector<std::int32_t>& start,
                const std::vector<double>& straight, bool across_triangles,
                const std::function<bool(const MeshFace&)>& through, const std::function<bool(std::int32_t)>& may_move,
                const std::function<void(const EdgeStep&)>& arrive);

/// Moves the nodes inside the faces of thin prisms and hexahedra as the nodes of the opposite face have moved, from the
/// faces on surfaces inwards. Returns, by node of the mesh, whether it was moved so.
/// @param on_surface by node: whether it lies on a surface element
std::vector<bool> move_faces_of_layers(const HighOrderMesh& mesh, const std::vector<bool>& on_surface,
                                       const std::vector<double>& straight, std::vector<double>& coordinates);

}  // namespace varimesh::detail
