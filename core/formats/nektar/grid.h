// What a mesh is for Nektar++: its vertices in an order that Nektar++ can orient, its edges and faces. Internal to
// core/formats.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>
#include <optional>
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

/// The nodes of a cell that is turned so: for each of its nodes, the local number in the cell as it was.
const std::vector<int>& nektar_turned_nodes(Shape shape, int order, const std::array<std::int8_t, 8>& turn);

/// The vertices of MFEM's face f of a cell, in the order of Nektar++'s face; those of a triangle ascending.
struct NektarFaceCorners {
  NektarFaceCorners(Shape shape, std::size_t f, std::span<const std::int32_t> cell);
  std::array<std::int32_t, 4> vertices{};
  std::size_t count = 0;
  operator std::span<const std::int32_t>() const { return {vertices.data(), count}; }
};

/// Remembers the nodes of turned cells for one thread, because a look into the cache takes a lock.
class NektarTurnedNodes {
 public:
  explicit NektarTurnedNodes(int order) : order_(order) {}
  const std::vector<int>& of(Shape shape, const std::array<std::int8_t, 8>& turn) {
    auto& known = known_[std::size_t(shape)][std::size_t(turn[0] % 4 + 4 * (turn[1] % 4) + 16 * (turn[2] % 4))];
    if (known == nullptr) known = &nektar_turned_nodes(shape, order_, turn);
    return *known;
  }

 private:
  int order_;
  std::array<std::array<const std::vector<int>*, 64>, kShapes> known_{};
};

/// Numbers of the edges or faces around a face or cell.
struct NektarSides {
  std::array<std::int32_t, 6> numbers{};
  std::size_t count = 0;
  operator std::span<const std::int32_t>() const { return {numbers.data(), count}; }
};

/// The vertices, edges and faces of a mesh, with the numbers that a file has. Lists of edges and faces would take more
/// memory than the numbers, so their vertices follow from the cells. Refers to the mesh.
class NektarGrid {
 public:
  /// `vertices`: of nektar_vertices(). Call it inside team.run().
  NektarGrid(const HighOrderMesh& mesh, std::vector<std::int32_t> vertices, const Team& team = Team(1));

  const HighOrderMesh& mesh;
  const Cells cells;

  std::size_t vertex_count() const { return std::size_t(topology_.vertex_count()); }
  std::size_t edge_count() const { return std::size_t(topology_.edge_count()); }
  /// 0 in 2-D.
  std::size_t face_count() const { return std::size_t(topology_.face_count()); }
  bool has_faces(Shape shape) const {
    return shape == Shape::Triangle ? topology_.has_triangles()
                                    : shape == Shape::Quadrilateral && topology_.has_quadrilaterals();
  }
  std::size_t triangles_before(std::size_t face) const {
    return std::size_t(topology_.triangles_before(std::int64_t(face)));
  }

  /// The points of all curves, each once: those on vertices, then those inside edges and faces, in 2-D those inside
  /// cells too. This is the mesh's node of each.
  std::span<const std::int32_t> points() const { return point_; }
  /// The points of an edge, face or, in 2-D, cell, in Gmsh's order, from its vertices.
  void points_of(Shape shape, std::span<const std::int32_t> vertices, std::int32_t interior,
                 std::span<std::int32_t> points) const {
    [[maybe_unused]] const bool found = topology_.find_nodes(shape, vertices, interior, points);
    assert(found);
  }
  /// The first point inside a cell of a 2-D mesh.
  std::int32_t interior(std::size_t cell) const;

  /// Calls body(cell, shape, vertices) for cells from begin to end − 1; `vertices` in Nektar++'s order.
  template <class Body>
  void for_cells(std::size_t begin, std::size_t end, const Body& body) const {
    for_cells_with_vertices(
        cells, begin, end, [&](Shape shape, std::span<const std::int32_t> nodes) { return vertices_of(shape, nodes); },
        body);
  }

  /// Calls body(edge, its two vertices, ascending) for edges from begin to end − 1, in order.
  template <class Body>
  void for_edges(std::size_t begin, std::size_t end, const Body& body) const;
  /// Calls body(face, shape, vertices) for faces from begin to end − 1, in order. Those of a triangle are ascending.
  template <class Body>
  void for_faces(std::size_t begin, std::size_t end, const Body& body) const;

  /// The edges of a face.
  NektarSides edges_around(std::span<const std::int32_t> vertices) const;
  /// The edges (2-D) or faces (3-D) of a cell, in Nektar++'s order.
  NektarSides sides(Shape shape, std::span<const std::int32_t> vertices) const;
  /// The number of the edge or face that a boundary element is; −1 if it is no side of a cell.
  std::int32_t side(Shape shape, std::span<const std::int32_t> nodes) const;
  /// The first cell that has other nodes on an edge or face than the first cell with the same vertices
  /// (shared_sides.h); nothing if there is none. Call it inside team.run().
  std::optional<std::size_t> unshared_side(const Team& team) const;
  /// Whether the mesh's nodes have the order in which a reader of the file numbers them.
  bool has_file_order() const;

 private:
  std::array<std::int32_t, 8> vertices_of(Shape shape, std::span<const std::int32_t> nodes) const {
    std::array<std::int32_t, 8> own{}, turned{};
    const auto used = std::size_t(reference::info(shape).vertices);
    for (std::size_t v = 0; v < used; ++v) own[v] = number_[std::size_t(nodes[v])];
    const auto turn = nektar_turn(shape, {own.data(), used});
    for (std::size_t v = 0; v < used; ++v) turned[v] = own[std::size_t(turn[v])];
    return turned;
  }
  /// A cell as the file has it.
  struct Turned {
    std::array<std::int32_t, 8> own{};  ///< The numbers of its vertices, in the mesh's order.
    std::array<std::int8_t, 8> turn{};
    const std::vector<int>* place = nullptr;  ///< Of nektar_turned_nodes().
  };
  Turned turned(Shape shape, std::span<const std::int32_t> nodes, NektarTurnedNodes& known) const;
  /// Places the points that a cell is the first to have.
  void place_points(std::size_t cell, Shape shape, std::span<const std::int32_t> nodes, NektarTurnedNodes& known);
  /// The last cell before which there are at most `count` edges or faces.
  template <class Before>
  std::size_t cell_of(std::size_t count, const Before& before) const;

  std::vector<std::int32_t> number_;  // of a vertex, by node
  MfemTopology topology_;
  std::vector<std::int32_t> point_;
  std::vector<std::int32_t> interior_;  // the first point inside the cells of each range, in 2-D
};

template <class Before>
std::size_t NektarGrid::cell_of(std::size_t count, const Before& before) const {
  std::size_t low = 0, high = cells.count();
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    (std::size_t(before(middle)) <= count ? low : high) = middle;
  }
  return low;
}

template <class Body>
void NektarGrid::for_edges(std::size_t begin, std::size_t end, const Body& body) const {
  if (begin >= end) return;
  const std::size_t first = cell_of(begin, [&](std::size_t cell) { return topology_.edges_before(cell); });
  auto edge = std::size_t(topology_.edges_before(first));
  for (std::size_t cell = first; edge < end; ++cell)
    for_cells(cell, cell + 1, [&](std::size_t, Shape shape, std::span<const std::int32_t> vertices) {
      const auto edges = edges_of(Sides::Mfem, shape);
      for (std::size_t e = 0; e < edges.size() && edge < end; ++e) {
        if (!topology_.is_first_edge(cell, e)) continue;
        const std::int32_t a = vertices[std::size_t(edges[e][0])], b = vertices[std::size_t(edges[e][1])];
        if (edge >= begin) body(edge, std::array{std::min(a, b), std::max(a, b)});
        ++edge;
      }
    });
}

template <class Body>
void NektarGrid::for_faces(std::size_t begin, std::size_t end, const Body& body) const {
  if (begin >= end) return;
  const std::size_t first = cell_of(begin, [&](std::size_t cell) { return topology_.faces_before(cell); });
  auto face = std::size_t(topology_.faces_before(first));
  for (std::size_t cell = first; face < end; ++cell)
    for_cells(cell, cell + 1, [&](std::size_t, Shape shape, std::span<const std::int32_t> vertices) {
      const auto faces = faces_of(Sides::Mfem, shape);
      for (std::size_t f = 0; f < faces.size() && face < end; ++f) {
        if (!topology_.is_first_face(cell, f)) continue;
        const NektarFaceCorners corners(shape, f, vertices);
        if (face >= begin) body(face, faces[f].shape, std::span<const std::int32_t>(corners));
        ++face;
      }
    });
}

}  // namespace varimesh::formats
