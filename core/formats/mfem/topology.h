// How MFEM numbers the edges and faces of a mesh, and with them the degrees of freedom of a continuous space.
// Internal to core/formats.
//
// Source: mfem.org, "Mesh formats" and "Finite elements"; MFEM's documentation of Mesh, FiniteElementSpace and
// H1_FECollection. Degrees of freedom are those of all vertices, all edges, all faces, and the interiors of all cells.
// Edges and faces are numbered as they are met, cell after cell. An edge goes from its vertex with the lower number to
// the other one. A face is numbered in the direction of the first cell that has it.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/formats/mfem/part_table.h"
#include "core/mesh/connectivity.h"
#include "core/reference/shape.h"

namespace varimesh::formats {

/// MFEM's edges of a cell, as pairs of its vertices. A line has itself.
std::span<const std::array<std::int8_t, 2>> mfem_edges(Shape shape);

/// MFEM's faces of a cell, each with its vertices in MFEM's order. A triangle or quadrilateral has itself.
std::span<const reference::Facet> mfem_faces(Shape shape);

struct MfemLocalNodes;

/// The cells whose edges and faces are numbered.
struct MfemCells {
  using Body = std::function<void(std::size_t cell, Shape shape, std::span<const std::int32_t> vertices)>;
  std::size_t count = 0;
  /// Calls the body for the cells from begin to end − 1, in order; several threads do so. The vertices have MFEM's
  /// order, which is Gmsh's.
  std::function<void(std::size_t begin, std::size_t end, const Body& body)> visit;
};

/// The cells of a mesh. vertices_of(shape, nodes) returns the vertices of a cell from its nodes. Refers to both.
template <class VerticesOf>
MfemCells mfem_cells(const Cells& cells, const VerticesOf& vertices_of) {
  return {cells.count(), [&](std::size_t begin, std::size_t end, const MfemCells::Body& body) {
            for (std::size_t cell = begin; cell < end;) {
              const Cells::Range& range = cells.range_of(cell);
              const Shape shape = range.block->shape;
              const std::size_t stop = std::min(end, range.first + range.block->size());
              for (; cell < stop; ++cell) {
                const std::span nodes(range.block->nodes.data() + (cell - range.first) * range.stride, range.stride);
                const std::array<std::int32_t, 8> vertices = vertices_of(shape, nodes);
                body(cell, shape, {vertices.data(), std::size_t(reference::info(shape).vertices)});
              }
            }
          }};
}

/// The edges and faces of a mesh, and its degrees of freedom.
class MfemTopology {
 public:
  /// Numbers the edges and faces. Cells come in the file's order. Throws ReadFailure if the file asks for too much
  /// memory, and Interrupted if the team is to stop. Call it inside team.run().
  ///
  /// @param vertices number of vertices; those of cells are below it
  /// @param counted  the scanner of the file from which the cells are read, which counts the memory; null: nothing does
  MfemTopology(int dimension, int order, std::int32_t vertices, const MfemCells& cells, const Team& team,
               const Scanner* counted = nullptr);

  std::int64_t vertex_count() const { return vertices_; }
  std::int64_t edge_count() const { return std::int64_t(edges_.size()); }
  std::int64_t face_count() const { return std::int64_t(triangles_.size() + quadrilaterals_.size()); }
  bool has_triangles() const { return triangles_.size() > 0; }
  bool has_quadrilaterals() const { return quadrilaterals_.size() > 0; }
  /// Whether a cell is the first that has its edge or face, counted as in mfem_edges() and mfem_faces().
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
  std::int32_t face(std::span<const std::int32_t> vertices) const;

  /// How many triangles are among the faces before this one, or among all if it is face_count().
  std::int64_t triangles_before(std::int64_t face) const;
  /// The first degree of freedom inside a face.
  std::int64_t face_first(std::int64_t face) const;

  /// The degrees of freedom on vertices, edges and faces. Those inside the cells follow.
  std::int64_t interior_first() const { return face_first(face_count()); }

  /// The nodes of a cell, or of an edge or face of a cell. Node k in Gmsh's order, on a vertex, edge or face of the
  /// mesh, is the degree of freedom nodes[k]. Those inside a cell are `interior`, `interior` + 1, and so on. Returns
  /// false if the mesh has no such edge or face, which cannot happen for a cell.
  bool find_nodes(Shape shape, std::span<const std::int32_t> vertices, std::int32_t interior,
                  std::span<std::int32_t> nodes) const;

 private:
  static constexpr std::size_t kMostEdges = 12, kMostFaces = 6;  // of a cell

  /// The place of a face in the table of its shape; −1 if no cell has it.
  std::int64_t place_of(std::span<const std::int32_t> vertices) const;
  std::int32_t face_at(std::size_t corners, std::int64_t place) const;
  void find_edges(const MfemCells& cells, const Team& team, const Scanner* counted);
  void find_faces(const MfemCells& cells, const Team& team, const Scanner* counted);
  void find_directions(const MfemCells& cells, const Team& team, const Scanner* counted);

  int dimension_, order_;
  std::int32_t vertices_;
  std::array<const MfemLocalNodes*, kShapes> local_{};
  RankedMarks first_edges_, first_faces_;  ///< By the cell and the place in it.
  PartTable<1> edges_;
  PartTable<2> triangles_;
  PartTable<3> quadrilaterals_;
  /// The direction of each face: that of its first cell. Which of its vertices, in ascending order, are the first and
  /// the second one, as first + 4 second. Empty if a face has too few nodes for it to matter.
  std::vector<std::uint8_t> triangle_directions_, quadrilateral_directions_;
  /// How many triangles are before each face, and all; empty unless triangles and quadrilaterals are mixed.
  std::vector<std::int32_t> triangles_before_;
};

/// The nodes of a cell's edges and faces, as Gmsh's local numbers.
struct MfemLocalNodes {
  /// For each edge of mfem_edges(), its inner nodes from its first to its second vertex.
  std::vector<std::vector<int>> edges;
  /// For each face of mfem_faces(), its inner nodes row by row. Entry 2 c begins at vertex c of the face and takes the
  /// next vertex as the first direction; entry 2 c + 1 takes the vertex before.
  std::vector<std::vector<std::vector<int>>> faces;
  /// For each face of mfem_faces(), all its nodes in Gmsh's order of the face's shape.
  std::vector<std::vector<int>> whole_faces;
};
const MfemLocalNodes& mfem_local_nodes(Shape shape, int order);

}  // namespace varimesh::formats
