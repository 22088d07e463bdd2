// The edges and faces of a mesh, each numbered once, with the direction in which it is first met: for readers, writers
// and the solver alike. What lies on the other side of a facet is in connectivity.h.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "core/mesh/connectivity.h"
#include "core/mesh/part_table.h"
#include "core/reference/shape.h"

namespace varimesh {

/// The edges and faces of a cell of each shape, in the order of a program, each with its vertices in that program's
/// order. A line has itself as its edge; a triangle or quadrilateral has itself as its face.
struct CellParts {
  std::span<const std::array<std::int8_t, 2>> (*edges)(Shape shape);
  std::span<const reference::Facet> (*faces)(Shape shape);
};

/// The edges and faces of reference::info(), which are Gmsh's.
extern const CellParts kGmshParts;

/// The cells whose edges and faces are numbered. They may be of several dimensions.
struct TopologyCells {
  using Body = std::function<void(std::size_t cell, Shape shape, std::span<const std::int32_t> vertices)>;
  std::size_t count = 0;
  /// Calls the body for the cells from begin to end − 1, in order; several threads do so. The vertices have Gmsh's
  /// order.
  std::function<void(std::size_t begin, std::size_t end, const Body& body)> visit;
};

/// Calls body(cell, shape, vertices) for cells from begin to end − 1. vertices_of(shape, nodes) returns the vertices of
/// a cell from its nodes, in an array of eight.
template <class VerticesOf, class Body>
void for_cells_with_vertices(const Cells& cells, std::size_t begin, std::size_t end, const VerticesOf& vertices_of,
                             const Body& body) {
  for (std::size_t cell = begin; cell < end;) {
    const Cells::Range& range = cells.range_of(cell);
    const Shape shape = range.block->shape;
    const std::size_t stop = std::min(end, range.first + range.block->size());
    for (; cell < stop; ++cell) {
      const std::span nodes(range.block->nodes.data() + (cell - range.first) * range.stride, range.stride);
      const std::array<std::int32_t, 8> vertices = vertices_of(shape, nodes);
      body(cell, shape, std::span(vertices.data(), std::size_t(reference::info(shape).vertices)));
    }
  }
}

/// The cells of a mesh. vertices_of(shape, nodes) returns the vertices of a cell from its nodes. Refers to both.
template <class VerticesOf>
TopologyCells topology_cells(const Cells& cells, const VerticesOf& vertices_of) {
  return {cells.count(), [&](std::size_t begin, std::size_t end, const TopologyCells::Body& body) {
            for_cells_with_vertices(cells, begin, end, vertices_of, body);
          }};
}

/// A face of the mesh, as its vertices in some order found it.
struct FaceAt {
  std::int32_t number = -1;  ///< −1: no cell has it.
  std::size_t corner = 0;    ///< Which of these vertices is the first vertex of the face.
  bool forward = true;       ///< Whether the vertex after it in this order is the second vertex of the face.
};

/// Edges and faces are numbered from 0 as they are met, cell after cell. An edge goes from its vertex with the lower
/// number to the other one. The first vertex of a face and its direction are those of the first cell that has it.
class Topology {
 public:
  /// The most edges and faces of a cell. "Occurrence" e of a cell is kMostEdges × cell + e, with 32 bits.
  static constexpr std::size_t kMostEdges = 12, kMostFaces = 6;
  static constexpr std::size_t kMostTopologyCells = std::numeric_limits<std::uint32_t>::max() / kMostEdges;

  /// Whether faces are numbered, and whether find_face() tells how a face is turned. That takes a byte per face.
  enum class Faces : std::uint8_t { None, Numbered, Turned };

  /// Numbers the edges and faces of at most kMostTopologyCells cells. Throws Interrupted if the team is to stop, and
  /// what `memory` throws. Call it inside team.run().
  ///
  /// @param vertices number of vertices; the vertices of cells are below it
  Topology(const CellParts& parts, Faces faces, std::int32_t vertices, const TopologyCells& cells, const Team& team,
           const CountMemory& memory = {});

  std::int64_t vertex_count() const { return vertices_; }
  std::int64_t edge_count() const { return std::int64_t(edges_.size()); }
  std::int64_t face_count() const { return std::int64_t(triangles_.size() + quadrilaterals_.size()); }
  bool has_faces() const { return faces_ != Faces::None; }
  bool has_triangles() const { return triangles_.size() > 0; }
  bool has_quadrilaterals() const { return quadrilaterals_.size() > 0; }

  /// Whether a cell is the first that has its edge or face, counted as in CellParts.
  bool is_first_edge(std::size_t cell, std::size_t edge) const {
    return first_edges_.is_marked(kMostEdges * cell + edge);
  }
  bool is_first_face(std::size_t cell, std::size_t face) const {
    return first_faces_.is_marked(kMostFaces * cell + face);
  }
  /// How many edges or faces the cells before this one have: the number of its first one that is new.
  std::int32_t edges_before(std::size_t cell) const { return std::int32_t(first_edges_.before(kMostEdges * cell)); }
  std::int32_t faces_before(std::size_t cell) const { return std::int32_t(first_faces_.before(kMostFaces * cell)); }

  /// Number of an edge or of a face; −1 if no cell has it.
  std::int32_t edge(std::int32_t a, std::int32_t b) const;
  std::int32_t face(std::span<const std::int32_t> vertices) const {
    return face_at(vertices.size(), place_of(vertices));
  }
  /// The face with these vertices, and how they are turned. With Faces::Turned, a face that has the vertices in an
  /// order that goes round it another way, along a diagonal, is none.
  FaceAt find_face(std::span<const std::int32_t> vertices) const;

  /// How many triangles are among the faces before this one, or among all if it is face_count().
  std::int64_t triangles_before(std::int64_t face) const;

 private:
  /// The place of a face in the table of its shape; −1 if no cell has it.
  std::int64_t place_of(std::span<const std::int32_t> vertices) const;
  std::int32_t face_at(std::size_t corners, std::int64_t place) const;
  void find_edges(const TopologyCells& cells, const Team& team, const CountMemory& memory);
  void find_faces(const TopologyCells& cells, const Team& team, const CountMemory& memory);
  void find_turns(const TopologyCells& cells, const Team& team, const CountMemory& memory);

  CellParts parts_of_cell_;
  Faces faces_;
  std::int32_t vertices_;
  RankedMarks first_edges_, first_faces_;  ///< By the cell and the place in it.
  PartTable<1> edges_;
  PartTable<2> triangles_;
  PartTable<3> quadrilaterals_;
  /// Which of the vertices of a face, in ascending order, are its first and second one, as first + 4 second. By place
  /// in the table; empty without Faces::Turned.
  std::vector<std::uint8_t> triangle_turns_, quadrilateral_turns_;
  /// How many triangles are before each face, and all; empty unless triangles and quadrilaterals are mixed.
  std::vector<std::int32_t> triangles_before_;
};

/// The topology of the cells of a mesh, with Gmsh's parts. The number of a vertex is the index of its node. Call it
/// inside team.run().
Topology topology(const HighOrderMesh& mesh, Topology::Faces faces, const Team& team = Team(1));

}  // namespace varimesh
