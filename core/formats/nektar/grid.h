// What a mesh is for Nektar++: its vertices in an order that Nektar++ can orient, its edges and faces. Internal to
// core/formats.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/error.h"
#include "core/formats/mfem/topology.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// The numbers of the vertices of cells, by node; −1 for other nodes. Coordinates of a triangle collapse towards its
/// vertex with the largest number. Both its cells agree on this vertex, because the numbers rise towards the apex of
/// each pyramid, and the vertices along the upright edges of prisms have consecutive numbers. Vertices keep the order
/// of the nodes where they can. Errors: BadOption if no such numbers exist, which happens if prisms or pyramids form a
/// ring.
Expected<std::vector<std::int32_t>> nektar_vertices(const HighOrderMesh& mesh);

/// A cell as Nektar++ takes it: Gmsh's local numbers of its vertices in the order of nektar_blending(), of the same
/// orientation as the cell.
std::array<std::int8_t, 8> nektar_turn(Shape shape, std::span<const std::int32_t> numbers);

/// The nodes of a cell that is turned so: for each of its nodes, the local number in the cell as it was. `numbers`: of
/// the vertices, by node.
std::vector<int> nektar_turned_nodes(Shape shape, int order, std::span<const std::int32_t> nodes,
                                     const std::vector<std::int32_t>& numbers);

/// The edges and faces of a mesh. Refers to the mesh.
class NektarGrid {
 public:
  NektarGrid(const HighOrderMesh& mesh, std::vector<std::int32_t> vertices, const Team& team = Team(1));

  const HighOrderMesh& mesh;
  std::vector<std::int32_t> vertex_nodes;          ///< By number.
  std::vector<std::array<std::int32_t, 2>> edges;  ///< Vertices, ascending.
  std::vector<std::array<std::int32_t, 4>> faces;  ///< Vertices; −1 at the end of a triangle. 3-D only.

  /// Calls body(block number, block, nodes, vertices) for each cell in the mesh's order; `vertices` in Nektar++'s
  /// order.
  template <class Body>
  void for_each_cell(const Body& body) const {
    for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
      const ElementBlock& block = mesh.blocks[b];
      const reference::ShapeInfo& info = reference::info(block.shape);
      if (info.dimension != mesh.dimension) continue;
      const auto count = std::size_t(reference::node_count(block.shape, block.order));
      for (std::size_t e = 0; e < block.size(); ++e) {
        const std::span nodes(block.nodes.data() + e * count, count);
        const std::array<std::int32_t, 8> turned = vertices_of(block.shape, nodes);
        body(b, block, nodes, std::span<const std::int32_t>(turned.data(), std::size_t(info.vertices)));
      }
    }
  }

  /// The vertices of a cell, in Nektar++'s order.
  std::array<std::int32_t, 8> vertices_of(Shape shape, std::span<const std::int32_t> nodes) const {
    std::array<std::int32_t, 8> own{}, turned{};
    const auto used = std::size_t(reference::info(shape).vertices);
    for (std::size_t v = 0; v < used; ++v) own[v] = number_[std::size_t(nodes[v])];
    const auto turn = nektar_turn(shape, {own.data(), used});
    for (std::size_t v = 0; v < used; ++v) turned[v] = own[std::size_t(turn[v])];
    return turned;
  }
  /// The numbers of the edges of a face.
  std::vector<std::int64_t> edges_around(std::span<const std::int32_t> vertices) const;
  /// The numbers of the edges (2-D) or faces (3-D) of a cell, in Nektar++'s order.
  std::vector<std::int64_t> sides(Shape shape, std::span<const std::int32_t> vertices) const;
  /// The number of the edge or face that a boundary element is; −1 if it is no side of a cell.
  std::int32_t side(Shape shape, std::span<const std::int32_t> nodes) const;
  /// Whether the mesh's nodes have the order in which a reader of the file numbers them.
  bool has_file_order() const;
  /// The mesh's nodes of an edge or face, in Gmsh's order, from its vertices.
  std::vector<std::int32_t> nodes_of(Shape shape, std::span<const std::int32_t> vertices) const;

 private:
  std::vector<std::int32_t> number_;  // by node
  MfemTopology topology_;
  std::vector<std::int32_t> node_of_;  // the mesh's node of each of the topology's
};

}  // namespace varimesh::formats
