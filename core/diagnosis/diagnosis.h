// What no movement of free nodes can repair, named: by vertex, elements, place and determinant, in sentences.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Elements that stay invalid wherever the free nodes go, because fixed nodes alone decide it.
struct UnrepairableGroup {
  enum class Kind : std::uint8_t {
    Vertex,       ///< One element at a vertex: its edges there are fixed, and their tangents span no volume.
    VertexGroup,  ///< Several elements at a vertex, fenced by fixed edges, for which the boundary leaves no room.
    Edge,         ///< One element along the edge of two fixed faces: J there depends on fixed nodes only.
    Face,         ///< One element on a face or inside: J there depends on fixed nodes only.
    FoldedFace,   ///< A flat fixed face (in 2-D a straight edge) that folds over itself: J = 0 in its elements.
    Fan,          ///< Elements round a free edge at a vertex, whose other edges there are fixed: whichever way the free
                  ///< edge leaves, one of them is not positive.
  };
  Kind kind = Kind::Vertex;
  std::int64_t vertex = 0;             ///< Node number as the file has it; 0 for edges and faces.
  std::vector<std::int64_t> elements;  ///< Element numbers as the file has them.
  std::vector<std::int32_t> cells;     ///< The same elements by their place among the mesh's cells, from 0.
  std::array<double, 3> place{};       ///< Physical coordinates.
  /// Dimensionless. At a vertex, det of the unit tangents of the three edges, or a fan's margin: the largest that the
  /// smallest n · x can be; along an edge, on a face or inside, J
  /// over the element's largest |J| there; for a folded face the smallest cosine between its normal and its mean
  /// normal, signed by the length of the normal over the largest.
  double determinant = 0;
  std::string sentence;  ///< For humans: what, where and what to do.
};

/// Leaves the groups of which an element is among these numbers. Of a group whose elements are all certified valid, one
/// has found a way round its vertex more than once, or another of the vertex's groups is turned in its stead.
std::vector<UnrepairableGroup> with_any_of(std::vector<UnrepairableGroup> groups,
                                           const std::vector<std::int64_t>& numbers);

/// Names what cannot be repaired if all nodes of fixed_nodes(mesh) are held (core/mesh/connectivity.h). `threads` 0
/// means all. diagnose.h says how it is found.
std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, int threads = 0);

}  // namespace varimesh
