#include "core/mesh/topology.h"

#include <algorithm>
#include <limits>

namespace varimesh {
namespace {

using reference::Facet;

constexpr std::size_t kCellsPerTask = 2048;

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
void for_each_cell(const TopologyCells& cells, const Team& team, const Body& body) {
  team.for_ranges(cells.count, kCellsPerTask,
                  [&](std::size_t begin, std::size_t end) { cells.visit(begin, end, body); });
}

}  // namespace

const CellParts kGmshParts{[](Shape shape) { return reference::info(shape).edges; },
                           [](Shape shape) { return reference::info(shape).faces; }};

Topology::Topology(const CellParts& parts, Faces faces, std::int32_t vertices, const TopologyCells& cells,
                   const Team& team, const CountMemory& memory)
    : parts_of_cell_(parts),
      faces_(faces),
      vertices_(vertices),
      first_edges_(kMostEdges * cells.count),
      first_faces_(has_faces() ? kMostFaces * cells.count : 0) {
  if (memory) memory(std::int64_t(2 * RankedMarks::bytes(kMostEdges * cells.count)));
  find_edges(cells, team, memory);
  if (!has_faces()) return;
  find_faces(cells, team, memory);
  if (faces_ == Faces::Turned) find_turns(cells, team, memory);
}

void Topology::find_edges(const TopologyCells& cells, const Team& team, const CountMemory& memory) {
  const auto visit = [&](const auto& enter) {
    for_each_cell(cells, team, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> vertices) {
      auto occurrence = std::uint32_t(kMostEdges * cell);
      for (const auto& [from, to] : parts_of_cell_.edges(shape)) {
        const std::int32_t a = vertices[std::size_t(from)], b = vertices[std::size_t(to)];
        enter(std::min(a, b), PartTable<1>::Rest{std::max(a, b)}, occurrence++);
      }
    });
  };
  edges_.build(vertices_, team, visit, first_edges_, memory);
  first_edges_.finish();
  edges_.number(first_edges_, team);
}

void Topology::find_faces(const TopologyCells& cells, const Team& team, const CountMemory& memory) {
  const auto of_shape = [&](Shape wanted, const auto& enter) {
    for_each_cell(cells, team, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> vertices) {
      auto occurrence = std::uint32_t(kMostFaces * cell);
      for (const Facet& face : parts_of_cell_.faces(shape)) {
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
  triangles_.build(vertices_, team, triangles, first_faces_, memory);
  quadrilaterals_.build(vertices_, team, quadrilaterals, first_faces_, memory);
  first_faces_.finish();
  triangles_.number(first_faces_, team);
  quadrilaterals_.number(first_faces_, team);
  if (!has_triangles() || !has_quadrilaterals()) return;
  if (memory) memory((face_count() + 1) * std::int64_t(sizeof triangles_before_[0]));
  triangles_before_.assign(std::size_t(face_count()) + 1, 0);
  for (const auto& triangle : triangles_.parts()) triangles_before_[triangle.number] = 1;
  sums_before(triangles_before_);
}

void Topology::find_turns(const TopologyCells& cells, const Team& team, const CountMemory& memory) {
  if (memory) memory(face_count());
  triangle_turns_.resize(triangles_.size());
  quadrilateral_turns_.resize(quadrilaterals_.size());
  for_each_cell(cells, team, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> vertices) {
    const auto faces = parts_of_cell_.faces(shape);
    for (std::size_t f = 0; f < faces.size(); ++f) {
      if (!is_first_face(cell, f)) continue;
      const FaceVertices own(faces[f], vertices);
      const auto sorted = ascending(own);
      const auto place = [&](std::int32_t v) { return std::find(sorted.begin(), sorted.end(), v) - sorted.begin(); };
      std::vector<std::uint8_t>& turns = own.count == 3 ? triangle_turns_ : quadrilateral_turns_;
      turns[std::size_t(place_of(own))] = std::uint8_t(place(own.vertices[0]) + 4 * place(own.vertices[1]));
    }
  });
}

std::int32_t Topology::edge(std::int32_t a, std::int32_t b) const {
  const std::int64_t place = edges_.find(std::min(a, b), {std::max(a, b)});
  return place < 0 ? -1 : std::int32_t(edges_.parts()[std::size_t(place)].number);
}

std::int64_t Topology::place_of(std::span<const std::int32_t> vertices) const {
  const auto v = ascending(vertices);
  return vertices.size() == 3 ? triangles_.find(v[0], {v[1], v[2]}) : quadrilaterals_.find(v[0], {v[1], v[2], v[3]});
}

std::int32_t Topology::face_at(std::size_t corners, std::int64_t place) const {
  if (place < 0) return -1;
  return std::int32_t(corners == 3 ? triangles_.parts()[std::size_t(place)].number
                                   : quadrilaterals_.parts()[std::size_t(place)].number);
}

FaceAt Topology::find_face(std::span<const std::int32_t> vertices) const {
  const std::int64_t place = place_of(vertices);
  FaceAt found{face_at(vertices.size(), place)};
  if (place < 0 || faces_ != Faces::Turned) return found;
  const std::size_t count = vertices.size();
  const auto sorted = ascending(vertices);
  const std::uint8_t turn = (count == 3 ? triangle_turns_ : quadrilateral_turns_)[std::size_t(place)];
  const std::int32_t first = sorted[turn % 4], second = sorted[turn / 4];
  while (found.corner + 1 < count && vertices[found.corner] != first) ++found.corner;
  found.forward = vertices[(found.corner + 1) % count] == second;
  if (!found.forward && vertices[(found.corner + count - 1) % count] != second) return {};
  return found;
}

std::int64_t Topology::triangles_before(std::int64_t face) const {
  if (!triangles_before_.empty()) return triangles_before_[std::size_t(face)];
  return has_quadrilaterals() ? 0 : face;
}

Topology topology(const HighOrderMesh& mesh, Topology::Faces faces, const Team& team) {
  const Cells cells(mesh, mesh.dimension);
  const auto vertices_of = [](Shape shape, std::span<const std::int32_t> nodes) {
    std::array<std::int32_t, 8> vertices{};
    std::copy_n(nodes.begin(), reference::info(shape).vertices, vertices.begin());
    return vertices;
  };
  return Topology(kGmshParts, faces, std::int32_t(mesh.node_count()), topology_cells(cells, vertices_of), team);
}

}  // namespace varimesh
