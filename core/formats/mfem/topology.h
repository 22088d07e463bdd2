// How MFEM numbers the edges and faces of a mesh, and with them the degrees of freedom of a continuous space.
// Internal to core/formats.
//
// Source: mfem.org, "Mesh formats" and "Finite elements"; MFEM's documentation of Mesh, FiniteElementSpace and
// H1_FECollection. Degrees of freedom are those of all vertices, all edges, all faces, and the interiors of all cells.
// Edges and faces are numbered as in core/mesh/topology.h, and the nodes inside them in the direction given there.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/io/scanner.h"
#include "core/formats/numbering/sides.h"
#include "core/mesh/topology.h"
#include "core/reference/shape.h"

namespace varimesh::formats {

struct MfemLocalNodes;

/// MFEM's edges and faces, for a Topology.
inline constexpr CellParts kMfemParts{[](Shape shape) { return edges_of(Sides::Mfem, shape); },
                                      [](Shape shape) { return faces_of(Sides::Mfem, shape); }};

/// The edges and faces of a mesh, and its degrees of freedom.
class MfemTopology : public Topology {
 public:
  /// Numbers the edges and faces. Cells come in the file's order. Throws ReadFailure if the file asks for too much
  /// memory, and Interrupted if the team is to stop. Call it inside team.run().
  ///
  /// @param vertices number of vertices; those of cells are below it
  /// @param counted  the scanner of the file from which the cells are read, which counts the memory; null: nothing does
  MfemTopology(int dimension, int order, std::int32_t vertices, const TopologyCells& cells, const Team& team,
               const Scanner* counted = nullptr);

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
  int order_;
  std::array<const MfemLocalNodes*, kShapes> local_{};
};

/// The nodes of a cell's edges and faces, as Gmsh's local numbers.
struct MfemLocalNodes {
  /// For each edge of edges_of(), its inner nodes from its first to its second vertex.
  std::vector<std::vector<int>> edges;
  /// For each face of faces_of(), its inner nodes row by row. Entry 2 c begins at vertex c of the face and takes the
  /// next vertex as the first direction; entry 2 c + 1 takes the vertex before.
  std::vector<std::vector<std::vector<int>>> faces;
  /// For each face of faces_of(), all its nodes in Gmsh's order of the face's shape.
  std::vector<std::vector<int>> whole_faces;
};
const MfemLocalNodes& mfem_local_nodes(Shape shape, int order);

}  // namespace varimesh::formats
