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
#include <span>
#include <vector>

#include "core/formats/scanner.h"
#include "core/reference/shape.h"

namespace varimesh::formats {

/// MFEM's edges of a cell, as pairs of its vertices. A line has itself.
std::span<const std::array<std::int8_t, 2>> mfem_edges(Shape shape);

/// MFEM's faces of a cell, each with its vertices in MFEM's order. A triangle or quadrilateral has itself.
std::span<const reference::Facet> mfem_faces(Shape shape);

struct MfemLocalNodes;

/// The edges and faces of a mesh, and its degrees of freedom. The vertices of cells have MFEM's order, which is
/// Gmsh's.
class MfemTopology {
 public:
  /// `counted`: the scanner of the file from which the cells are read, which counts the memory; null: nothing does. It
  /// must outlive the last call of finish().
  MfemTopology(int dimension, int order, std::int32_t vertices, const Scanner* counted = nullptr);

  /// Numbers the edges and faces of a cell that are new. Cells come in the file's order. Throws ReadFailure if the file
  /// asks for too much memory.
  void add(Shape shape, std::span<const std::int32_t> vertices);

  /// Must be called after the last cell.
  void finish();

  std::int64_t vertex_count() const { return vertices_; }
  std::int64_t edge_count() const { return std::int64_t(edges_.size()); }
  std::int64_t face_count() const { return std::int64_t(faces_.size()); }
  bool has_quadrilaterals() const { return triangles_ < face_count(); }
  /// Number of an edge or of a face; −1 if no cell has it.
  std::int32_t edge(std::int32_t a, std::int32_t b) const;
  std::int32_t face(std::span<const std::int32_t> vertices) const;

  /// The degrees of freedom on vertices, edges and faces. Those inside the cells follow.
  std::int64_t interior_first() const { return face_first(face_count()); }

  /// The nodes of a cell, or of an edge or face of a cell. Node k in Gmsh's order, on a vertex, edge or face of the
  /// mesh, is the degree of freedom nodes[k]. Those inside a cell are `interior`, `interior` + 1, and so on. Returns
  /// false if the mesh has no such edge or face, which cannot happen for a cell that was added.
  bool find_nodes(Shape shape, std::span<const std::int32_t> vertices, std::int32_t interior,
                  std::span<std::int32_t> nodes) const;

 private:
  struct Edge {
    std::array<std::int32_t, 2> vertices;  ///< Ascending.
    std::int32_t next;                     ///< The next edge in the same bucket, or −1.
  };
  struct Face {
    std::array<std::int32_t, 4> vertices;  ///< In the direction of its first cell; −1 at the end of a triangle.
    std::int32_t next;                     ///< The next face in the same bucket, or −1.
  };
  std::int64_t face_first(std::int64_t face) const;

  int dimension_, order_;
  std::int32_t vertices_;
  const Scanner* counted_;
  std::array<const MfemLocalNodes*, kShapes> local_{};
  // Hash tables by all vertices. Lists by one vertex would be long if many cells share it.
  std::vector<std::int32_t> edge_buckets_, face_buckets_;  ///< The first edge or face of each bucket, or −1.
  std::vector<Edge> edges_;
  std::vector<Face> faces_;
  std::int64_t triangles_ = 0;
  /// The first degree of freedom of each face, counted from the first of all faces, if triangles and quadrilaterals are
  /// mixed.
  std::vector<std::int64_t> face_first_;
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
