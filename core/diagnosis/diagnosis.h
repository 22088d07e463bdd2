// What no movement of free nodes can repair: the elements, the place, the determinant, and a sentence that says why.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Elements that stay invalid wherever the free nodes go, because only fixed nodes decide there.
struct UnrepairableGroup {
  enum class Kind : std::uint8_t {
    Vertex,       ///< One element at a vertex: its edges there are fixed, and their tangents span no volume.
    VertexGroup,  ///< Several elements at a vertex, enclosed by fixed edges. The boundary leaves no room for them.
    Edge,         ///< One element along the edge between two fixed faces: J there depends on fixed nodes only.
    Face,         ///< One element, on a face or inside: J there depends on fixed nodes only.
    FoldedFace,   ///< A flat fixed face (in 2-D a straight edge) that folds over itself: J = 0 in its elements. Or a
                  ///< curved fixed triangle that turns so far within itself that it leaves hardly any room.
    Fan,          ///< Elements at a vertex that share one free edge and have no other free edge there. Whatever the
                  ///< direction of this edge, J at the vertex is not positive in at least one of the elements.
  };
  Kind kind = Kind::Vertex;
  std::int64_t vertex = 0;             ///< Node number as the file has it; 0 for edges and faces.
  std::vector<std::int64_t> elements;  ///< Element numbers as the file has them.
  std::vector<std::int32_t> cells;     ///< The same elements by their place among the mesh's cells, from 0.
  std::array<double, 3> place{};       ///< Physical coordinates.
  /// Dimensionless. At a vertex: the determinant of the unit tangents of the three edges. For a fan: its margin, the
  /// largest value that the smallest n · x can have. Along an edge, on a face or inside: J there over the element's
  /// largest |J|. For a flat folded face: the smallest component of a normal along the longest normal, over the length
  /// of the longest normal; at most 0. For a curved one: the room that it leaves, above 0; a flat face leaves 1.
  double determinant = 0;
  std::string sentence;  ///< For humans: what, where and what to do.
};

/// Whether it is proved that at least one element of the group stays invalid. It is not if the determinant is positive
/// but so small that there is hardly any room, and not for a vertex group: the diagnosis chooses the groups that need
/// the least turning, and all elements of a group may be valid if they wind around an edge more than once.
inline bool is_proved(const UnrepairableGroup& group) {
  return group.kind != UnrepairableGroup::Kind::VertexGroup && group.determinant <= 0;
}

/// By cell, for `cells` cells: 1 if it is in a group for which is_proved() holds, or in a vertex group. Elements at a
/// curved face that leaves some room are not among them: several of these become valid.
std::vector<char> cells_beyond_repair(std::span<const UnrepairableGroup> groups, std::size_t cells);

/// Keeps the groups that have at least one of these elements. If all elements of a group are certified valid, one of
/// them goes around its vertex more than once, or another of the vertex's groups is turned inside out instead.
std::vector<UnrepairableGroup> with_any_of(std::vector<UnrepairableGroup> groups,
                                           const std::vector<std::int64_t>& numbers);

/// A lower bound on the elements that stay invalid if each group keeps one. An element may be in several groups, so the
/// groups that count share none: they are taken, smallest first, if they have no element of one taken before.
std::size_t least_invalid(const std::vector<UnrepairableGroup>& groups);

/// Finds what cannot be repaired if all nodes of fixed_nodes(mesh) are fixed (core/mesh/connectivity.h). `threads` 0
/// means all. diagnose.h has the conditions. Nothing is found on a surface in space, whose nodes do not move at all.
std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, int threads = 0);

}  // namespace varimesh
