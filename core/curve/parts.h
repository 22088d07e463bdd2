// The edges and faces of a mesh of order P, each once, with their nodes. Internal to the library.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// An edge of a cell or of a surface element.
struct MeshEdge {
  std::array<std::int32_t, 2> ends{};  ///< The smaller index first.
  std::vector<std::int32_t> inner;     ///< The nodes between, from ends[0] to ends[1].
  std::vector<int> surfaces;           ///< Surfaces of the elements around it, sorted; −1: one that did not match.
  int elements = 0;                    ///< How many surface elements have it.
};

/// A face of a cell, or a surface element.
struct MeshFace {
  Shape shape = Shape::Triangle;
  std::vector<std::int32_t> nodes;  ///< All nodes in Gmsh's order.
  bool on_surface = false;          ///< There is a surface element.
  int surface = -1;                 ///< Its surface; −1: none, or it did not match.
  std::vector<std::int32_t> edges;  ///< Indices of its edges, in the order of the shape's facets.
};

/// Faces are numbered through the surface elements first, then through the faces of the cells, in the mesh's order.
/// Edges are numbered through the faces.
struct MeshParts {
  std::vector<MeshEdge> edges;
  std::vector<MeshFace> faces;

  MeshParts() = default;
  /// @param surface_of_element  as Association has it
  MeshParts(const HighOrderMesh& mesh, const std::vector<std::vector<int>>& surface_of_element);

 private:
  using Vertices = std::array<std::int32_t, 4>;  // sorted; a triangle has −1 first
  struct HashVertices {
    std::size_t operator()(const Vertices& v) const;
  };
  void add_face(Shape shape, int order, std::vector<std::int32_t> nodes, bool on_surface, int surface);
  std::int32_t edge(const std::vector<std::int32_t>& nodes);

  std::unordered_map<Vertices, std::int32_t, HashVertices> known_;
};

}  // namespace varimesh::detail
