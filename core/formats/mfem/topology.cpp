#include "core/formats/mfem/topology.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <string>

#include "core/formats/node_order.h"
#include "core/reference/cache.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

// === The edges and faces of a cell: Geometry::Constants in MFEM's documentation ==========================

namespace {

using Edge = std::array<std::int8_t, 2>;
using reference::Facet;

constexpr Facet triangle(std::int8_t a, std::int8_t b, std::int8_t c) { return {Shape::Triangle, {a, b, c, -1}}; }
constexpr Facet quadrilateral(std::int8_t a, std::int8_t b, std::int8_t c, std::int8_t d) {
  return {Shape::Quadrilateral, {a, b, c, d}};
}

constexpr std::array<Edge, 1> kLineEdges{{{0, 1}}};
constexpr std::array<Edge, 3> kTriangleEdges{{{0, 1}, {1, 2}, {2, 0}}};
constexpr std::array<Edge, 4> kQuadrilateralEdges{{{0, 1}, {1, 2}, {2, 3}, {3, 0}}};
constexpr std::array<Edge, 6> kTetrahedronEdges{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
constexpr std::array<Edge, 8> kPyramidEdges{{{0, 1}, {1, 2}, {3, 2}, {0, 3}, {0, 4}, {1, 4}, {2, 4}, {3, 4}}};
constexpr std::array<Edge, 9> kPrismEdges{{{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}}};
constexpr std::array<Edge, 12> kHexahedronEdges{
    {{0, 1}, {1, 2}, {3, 2}, {0, 3}, {4, 5}, {5, 6}, {7, 6}, {4, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};

constexpr std::array<Facet, 1> kTriangleFaces{triangle(0, 1, 2)};
constexpr std::array<Facet, 1> kQuadrilateralFaces{quadrilateral(0, 1, 2, 3)};
constexpr std::array<Facet, 4> kTetrahedronFaces{triangle(1, 2, 3), triangle(0, 3, 2), triangle(0, 1, 3),
                                                 triangle(0, 2, 1)};
constexpr std::array<Facet, 5> kPyramidFaces{quadrilateral(3, 2, 1, 0), triangle(0, 1, 4), triangle(1, 2, 4),
                                             triangle(2, 3, 4), triangle(3, 0, 4)};
constexpr std::array<Facet, 5> kPrismFaces{triangle(0, 2, 1), triangle(3, 4, 5), quadrilateral(0, 1, 4, 3),
                                           quadrilateral(1, 2, 5, 4), quadrilateral(2, 0, 3, 5)};
constexpr std::array<Facet, 6> kHexahedronFaces{quadrilateral(3, 2, 1, 0), quadrilateral(0, 1, 5, 4),
                                                quadrilateral(1, 2, 6, 5), quadrilateral(2, 3, 7, 6),
                                                quadrilateral(3, 0, 4, 7), quadrilateral(4, 5, 6, 7)};

}  // namespace

std::span<const Edge> mfem_edges(Shape shape) {
  switch (shape) {
    case Shape::Point:
      return {};
    case Shape::Line:
      return kLineEdges;
    case Shape::Triangle:
      return kTriangleEdges;
    case Shape::Quadrilateral:
      return kQuadrilateralEdges;
    case Shape::Tetrahedron:
      return kTetrahedronEdges;
    case Shape::Pyramid:
      return kPyramidEdges;
    case Shape::Prism:
      return kPrismEdges;
    case Shape::Hexahedron:
      return kHexahedronEdges;
  }
  return {};
}

std::span<const Facet> mfem_faces(Shape shape) {
  switch (shape) {
    case Shape::Point:
    case Shape::Line:
      return {};
    case Shape::Triangle:
      return kTriangleFaces;
    case Shape::Quadrilateral:
      return kQuadrilateralFaces;
    case Shape::Tetrahedron:
      return kTetrahedronFaces;
    case Shape::Pyramid:
      return kPyramidFaces;
    case Shape::Prism:
      return kPrismFaces;
    case Shape::Hexahedron:
      return kHexahedronFaces;
  }
  return {};
}

// === Local nodes =========================================================================================

namespace {

MfemLocalNodes make_local_nodes(Shape shape, int order) {
  const auto& lattice = reference::lattice(shape, order);
  const std::vector<int>& by_position = nodes_by_position(shape, order);
  const auto side = std::size_t(order) + 1;
  const auto vertex = [&](std::int8_t v) {
    const auto& at = lattice[std::size_t(v)];
    return Position{at[0], at[1], at[2]};
  };
  const auto numbers = [&](const Positions& list) {
    std::vector<int> nodes;
    for (const auto& [i, j, k] : list)
      nodes.push_back(by_position[std::size_t(i) + side * (std::size_t(j) + side * std::size_t(k))]);
    return nodes;
  };
  MfemLocalNodes local;
  for (const auto& [a, b] : mfem_edges(shape)) {
    Positions list;
    add_edge(list, vertex(a), vertex(b), order);
    local.edges.push_back(numbers(list));
  }
  for (const Facet& face : mfem_faces(shape)) {
    const int n = reference::info(face.shape).vertices;
    const auto corner = [&](int c) { return vertex(face.vertices[std::size_t((c + n) % n)]); };
    std::vector<std::vector<int>> variants;
    for (int c = 0; c < n; ++c)
      for (const int step : {1, -1}) {
        Positions list;
        add_face_rows(list, corner(c), corner(c + step), corner(c - step), order, n == 3);
        variants.push_back(numbers(list));
      }
    local.faces.push_back(std::move(variants));
    Positions whole;
    for (const auto& at : reference::lattice(face.shape, order)) {
      Position p = corner(0);
      for (std::size_t k = 0; k < 3; ++k)
        p[k] += (corner(1)[k] - corner(0)[k]) / order * at[0] + (corner(n - 1)[k] - corner(0)[k]) / order * at[1];
      whole.push_back(p);
    }
    local.whole_faces.push_back(numbers(whole));
  }
  return local;
}

/// The vertices of a face, ascending; those of a triangle end with the largest int. Without branches, because this is
/// done for every face of every cell.
std::array<std::int32_t, 4> ascending(std::span<const std::int32_t> vertices) {
  constexpr std::int32_t kNone = std::numeric_limits<std::int32_t>::max();
  std::int32_t a = vertices[0], b = vertices[1], c = vertices[2], d = vertices.size() > 3 ? vertices[3] : kNone;
  const auto order = [](std::int32_t& x, std::int32_t& y) {
    const std::int32_t low = std::min(x, y);
    y = std::max(x, y);
    x = low;
  };
  order(a, b), order(c, d), order(a, c), order(b, d), order(b, c);
  return {a, b, c, d};
}

int inner_nodes(Shape shape, int order) {
  return shape == Shape::Triangle ? (order - 1) * (order - 2) / 2 : (order - 1) * (order - 1);
}

}  // namespace

const MfemLocalNodes& mfem_local_nodes(Shape shape, int order) {
  static reference::Cache<std::array<int, 2>, MfemLocalNodes> cache;
  return cache.get({int(shape), order}, [&] { return make_local_nodes(shape, order); });
}

// === The mesh's edges and faces ==========================================================================

namespace {

constexpr std::size_t kCellsPerTask = 2048;

/// The vertices of a face of a cell.
struct FaceVertices {
  std::array<std::int32_t, 4> vertices{};
  std::size_t count = 0;

  FaceVertices(const Facet& face, std::span<const std::int32_t> cell) : count(face.shape == Shape::Triangle ? 3 : 4) {
    for (std::size_t v = 0; v < count; ++v) vertices[v] = cell[std::size_t(face.vertices[v])];
  }
  operator std::span<const std::int32_t>() const { return {vertices.data(), count}; }
};

/// Calls body(cell, shape, vertices) for all cells; the team shares them.
template <class Body>
void for_each_cell(const MfemCells& cells, const Team& team, const Body& body) {
  team.for_ranges(cells.count, kCellsPerTask,
                  [&](std::size_t begin, std::size_t end) { cells.visit(begin, end, body); });
}

}  // namespace

MfemTopology::MfemTopology(int dimension, int order, std::int32_t vertices, const MfemCells& cells, const Team& team,
                           const Scanner* counted)
    : dimension_(dimension),
      order_(order),
      vertices_(vertices),
      first_edges_(kMostEdges * cells.count),
      first_faces_(dimension == 3 ? kMostFaces * cells.count : 0) {
  constexpr std::size_t kMostOccurrences = std::numeric_limits<std::uint32_t>::max();
  if (counted != nullptr && cells.count > kMostOccurrences / kMostEdges)
    counted->fail("the mesh has " + std::to_string(cells.count) + " elements, more than VariMesh takes");
  if (counted != nullptr) counted->take_memory(2 * RankedMarks::bytes(kMostEdges * cells.count));
  for (int shape = int(Shape::Line); shape < kShapes; ++shape)
    local_[std::size_t(shape)] = &mfem_local_nodes(Shape(shape), order_);
  find_edges(cells, team, counted);
  if (dimension == 3) find_faces(cells, team, counted);
}

void MfemTopology::find_edges(const MfemCells& cells, const Team& team, const Scanner* counted) {
  const auto visit = [&](const auto& enter) {
    for_each_cell(cells, team, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> vertices) {
      auto occurrence = std::uint32_t(kMostEdges * cell);
      for (const auto& [from, to] : mfem_edges(shape)) {
        const std::int32_t a = vertices[std::size_t(from)], b = vertices[std::size_t(to)];
        enter(std::min(a, b), PartTable<1>::Rest{std::max(a, b)}, occurrence++);
      }
    });
  };
  edges_.build(vertices_, team, visit, first_edges_, counted);
  first_edges_.finish();
  edges_.number(first_edges_, team);
}

void MfemTopology::find_faces(const MfemCells& cells, const Team& team, const Scanner* counted) {
  const auto of_shape = [&](Shape wanted, const auto& enter) {
    for_each_cell(cells, team, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> vertices) {
      auto occurrence = std::uint32_t(kMostFaces * cell);
      for (const Facet& face : mfem_faces(shape)) {
        if (face.shape == wanted) enter(ascending(FaceVertices(face, vertices)), occurrence);
        ++occurrence;
      }
    });
  };
  const auto triangles = [&](const auto& enter) {
    of_shape(Shape::Triangle, [&](const std::array<std::int32_t, 4>& v, std::uint32_t occurrence) {
      enter(v[0], PartTable<2>::Rest{v[1], v[2]}, occurrence);
    });
  };
  const auto quadrilaterals = [&](const auto& enter) {
    of_shape(Shape::Quadrilateral, [&](const std::array<std::int32_t, 4>& v, std::uint32_t occurrence) {
      enter(v[0], PartTable<3>::Rest{v[1], v[2], v[3]}, occurrence);
    });
  };
  triangles_.build(vertices_, team, triangles, first_faces_, counted);
  quadrilaterals_.build(vertices_, team, quadrilaterals, first_faces_, counted);
  first_faces_.finish();
  triangles_.number(first_faces_, team);
  quadrilaterals_.number(first_faces_, team);
  if (triangles_.size() > 0 && quadrilaterals_.size() > 0) {
    if (counted != nullptr) counted->take_memory((std::size_t(face_count()) + 1) * sizeof triangles_before_[0]);
    triangles_before_.assign(std::size_t(face_count()) + 1, 0);
    for (const auto& triangle : triangles_.parts()) triangles_before_[triangle.number] = 1;
    sums_before(triangles_before_);
  }
  if (inner_nodes(Shape::Triangle, order_) > 1 || inner_nodes(Shape::Quadrilateral, order_) > 1)
    find_directions(cells, team, counted);
}

void MfemTopology::find_directions(const MfemCells& cells, const Team& team, const Scanner* counted) {
  if (counted != nullptr) counted->take_memory(std::size_t(face_count()));
  triangle_directions_.resize(triangles_.size());
  quadrilateral_directions_.resize(quadrilaterals_.size());
  for_each_cell(cells, team, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> vertices) {
    const auto faces = mfem_faces(shape);
    for (std::size_t f = 0; f < faces.size(); ++f) {
      if (!is_first_face(cell, f)) continue;
      const FaceVertices own(faces[f], vertices);
      const auto sorted = ascending(own);
      const auto place = [&](std::int32_t v) { return std::find(sorted.begin(), sorted.end(), v) - sorted.begin(); };
      std::vector<std::uint8_t>& directions = own.count == 3 ? triangle_directions_ : quadrilateral_directions_;
      directions[std::size_t(place_of(own))] = std::uint8_t(place(own.vertices[0]) + 4 * place(own.vertices[1]));
    }
  });
}

std::int32_t MfemTopology::edge(std::int32_t a, std::int32_t b) const {
  const std::int64_t place = edges_.find(std::min(a, b), {std::max(a, b)});
  return place < 0 ? -1 : std::int32_t(edges_.parts()[std::size_t(place)].number);
}

std::int64_t MfemTopology::place_of(std::span<const std::int32_t> vertices) const {
  const auto v = ascending(vertices);
  return vertices.size() == 3 ? triangles_.find(v[0], {v[1], v[2]}) : quadrilaterals_.find(v[0], {v[1], v[2], v[3]});
}

std::int32_t MfemTopology::face_at(std::size_t corners, std::int64_t place) const {
  if (place < 0) return -1;
  return std::int32_t(corners == 3 ? triangles_.parts()[std::size_t(place)].number
                                   : quadrilaterals_.parts()[std::size_t(place)].number);
}

std::int32_t MfemTopology::face(std::span<const std::int32_t> vertices) const {
  return face_at(vertices.size(), place_of(vertices));
}

std::int64_t MfemTopology::triangles_before(std::int64_t face) const {
  if (!triangles_before_.empty()) return triangles_before_[std::size_t(face)];
  return has_quadrilaterals() ? 0 : face;
}

std::int64_t MfemTopology::face_first(std::int64_t face) const {
  const std::int64_t first = vertex_count() + edge_count() * (order_ - 1), triangles = triangles_before(face);
  return first + triangles * inner_nodes(Shape::Triangle, order_) +
         (face - triangles) * inner_nodes(Shape::Quadrilateral, order_);
}

bool MfemTopology::find_nodes(Shape shape, std::span<const std::int32_t> vertices, std::int32_t interior,
                              std::span<std::int32_t> nodes) const {
  const MfemLocalNodes& local = *local_[std::size_t(shape)];
  std::copy(vertices.begin(), vertices.end(), nodes.begin());
  std::size_t filled = vertices.size();
  const auto edges = mfem_edges(shape);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const std::int32_t a = vertices[std::size_t(edges[e][0])], b = vertices[std::size_t(edges[e][1])];
    const std::int32_t number = edge(a, b);
    if (number < 0) return false;
    std::int32_t next = std::int32_t(vertex_count() + std::int64_t(number) * (order_ - 1));
    const std::vector<int>& inner = local.edges[e];
    for (std::size_t i = 0; i < inner.size(); ++i)
      nodes[std::size_t(a < b ? inner[i] : inner[inner.size() - 1 - i])] = next++;
    filled += inner.size();
  }
  // The faces of a cell are known, so those without nodes need no search.
  const bool searched = reference::info(shape).dimension < 3 || filled < nodes.size();
  if (dimension_ == 3 && searched) {
    const auto faces = mfem_faces(shape);
    for (std::size_t f = 0; f < faces.size(); ++f) {
      const FaceVertices own(faces[f], vertices);
      const std::int64_t place = place_of(own);
      if (place < 0) return false;
      const std::int32_t number = face_at(own.count, place);
      std::size_t corner = 0;
      bool forward = true;
      if (const auto& directions = own.count == 3 ? triangle_directions_ : quadrilateral_directions_;
          !directions.empty()) {
        const auto sorted = ascending(own);
        const std::uint8_t direction = directions[std::size_t(place)];
        const std::int32_t first = sorted[direction % 4], second = sorted[direction / 4];
        while (corner + 1 < own.count && own.vertices[corner] != first) ++corner;
        forward = own.vertices[(corner + 1) % own.count] == second;
        if (!forward && own.vertices[(corner + own.count - 1) % own.count] != second) return false;
      }
      std::int32_t next = std::int32_t(face_first(number));
      const std::vector<int>& inner = local.faces[f][2 * corner + (forward ? 0 : 1)];
      for (const int node : inner) nodes[std::size_t(node)] = next++;
      filled += inner.size();
    }
  }
  if (reference::info(shape).dimension == dimension_)
    for (; filled < nodes.size(); ++filled) nodes[filled] = interior++;
  return true;
}

}  // namespace varimesh::formats
