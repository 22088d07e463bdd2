#include "core/formats/nektar/grid.h"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <queue>

#include "core/formats/mfem/shared_sides.h"
#include "core/formats/mfem/space.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/numbering/node_order.h"
#include "core/reference/cache.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

constexpr std::size_t kCellsPerTask = 2048;

/// Calls body(shape, nodes of the vertices) for each cell.
template <class Body>
void for_each(const HighOrderMesh& mesh, const Body& body) {
  for (const ElementBlock& block : mesh.blocks) {
    const reference::ShapeInfo& info = reference::info(block.shape);
    if (info.dimension != mesh.dimension) continue;
    const auto count = std::size_t(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e)
      body(block.shape, std::span(block.nodes.data() + e * count, std::size_t(info.vertices)));
  }
}

/// Nodes that the upright edges of prisms join; each set is known by its lowest node.
class Columns {
 public:
  explicit Columns(std::size_t nodes) : up_(nodes) { std::iota(up_.begin(), up_.end(), 0); }
  std::int32_t of(std::int32_t node) {
    while (up_[std::size_t(node)] != node) node = up_[std::size_t(node)] = up_[std::size_t(up_[std::size_t(node)])];
    return node;
  }
  void join(std::int32_t a, std::int32_t b) {
    a = of(a), b = of(b);
    up_[std::size_t(std::max(a, b))] = std::min(a, b);
  }

 private:
  std::vector<std::int32_t> up_;
};

/// Columns in an order in which that of a pyramid's apex comes after those of its base, otherwise by their lowest node.
/// Empty if there is no such order.
std::vector<std::int32_t> ordered(std::vector<std::pair<std::int32_t, std::int32_t>> rises, Columns& columns,
                                  const std::vector<bool>& is_vertex) {
  std::sort(rises.begin(), rises.end());
  rises.erase(std::unique(rises.begin(), rises.end()), rises.end());
  std::vector<std::int32_t> below(is_vertex.size(), 0), order;
  for (const auto& [from, to] : rises) ++below[std::size_t(to)];
  std::priority_queue<std::int32_t, std::vector<std::int32_t>, std::greater<>> free;
  std::size_t count = 0;
  for (std::size_t node = 0; node < is_vertex.size(); ++node) {
    if (!is_vertex[node] || columns.of(std::int32_t(node)) != std::int32_t(node)) continue;
    ++count;
    if (below[node] == 0) free.push(std::int32_t(node));
  }
  while (!free.empty()) {
    order.push_back(free.top());
    free.pop();
    auto rise = std::lower_bound(rises.begin(), rises.end(), std::pair(order.back(), std::int32_t(-1)));
    for (; rise != rises.end() && rise->first == order.back(); ++rise)
      if (--below[std::size_t(rise->second)] == 0) free.push(rise->second);
  }
  return order.size() == count ? order : std::vector<std::int32_t>();
}

bool has_columns(const HighOrderMesh& mesh) {
  return std::any_of(mesh.blocks.begin(), mesh.blocks.end(), [](const ElementBlock& block) {
    return block.shape == Shape::Prism || block.shape == Shape::Pyramid;
  });
}

/// The numbers of vertices that keep the order of the nodes.
std::vector<std::int32_t> vertices_in_order(const HighOrderMesh& mesh) {
  std::vector<std::int32_t> numbers(mesh.node_count(), -1);
  for_each(mesh, [&](Shape, std::span<const std::int32_t> v) {
    for (const std::int32_t node : v) numbers[std::size_t(node)] = 0;
  });
  std::int32_t next = 0;
  for (std::int32_t& number : numbers)
    if (number == 0) number = next++;
  return numbers;
}

}  // namespace

Expected<std::vector<std::int32_t>> nektar_vertices(const HighOrderMesh& mesh) {
  if (!has_columns(mesh)) return vertices_in_order(mesh);
  Columns columns(mesh.node_count());
  std::vector<bool> is_vertex(mesh.node_count(), false);
  for_each(mesh, [&](Shape shape, std::span<const std::int32_t> v) {
    for (const std::int32_t node : v) is_vertex[std::size_t(node)] = true;
    if (shape == Shape::Prism)
      for (std::size_t k = 0; k < 3; ++k) columns.join(v[k], v[k + 3]);
  });
  std::vector<std::pair<std::int32_t, std::int32_t>> rises;
  bool ring = false;
  for_each(mesh, [&](Shape shape, std::span<const std::int32_t> v) {
    if (shape == Shape::Prism)
      ring = ring || columns.of(v[0]) == columns.of(v[1]) || columns.of(v[1]) == columns.of(v[2]) ||
             columns.of(v[2]) == columns.of(v[0]);
    if (shape == Shape::Pyramid)
      for (std::size_t k = 0; k < 4; ++k) rises.emplace_back(columns.of(v[k]), columns.of(v[4]));
  });
  const std::vector<std::int32_t> order = ordered(std::move(rises), columns, is_vertex);
  if (ring || (order.empty() && std::find(is_vertex.begin(), is_vertex.end(), true) != is_vertex.end()))
    return bad_option(
        "Nektar++ cannot orient this mesh: prisms or pyramids form a ring in which no vertex can be the last; mesh it "
        "with tetrahedra or hexahedra there, or write another format.");
  std::vector<std::int32_t> place(mesh.node_count(), 0);  // of a column
  for (std::size_t k = 0; k < order.size(); ++k) place[std::size_t(order[k])] = std::int32_t(k);
  std::vector<std::pair<std::int32_t, std::int32_t>> sorted;  // column, node
  for (std::size_t node = 0; node < is_vertex.size(); ++node)
    if (is_vertex[node]) sorted.emplace_back(place[std::size_t(columns.of(std::int32_t(node)))], std::int32_t(node));
  std::sort(sorted.begin(), sorted.end());
  std::vector<std::int32_t> numbers(mesh.node_count(), -1);
  for (std::size_t k = 0; k < sorted.size(); ++k) numbers[std::size_t(sorted[k].second)] = std::int32_t(k);
  return numbers;
}

std::array<std::int8_t, 8> nektar_turn(Shape shape, std::span<const std::int32_t> numbers) {
  std::array<std::int8_t, 8> turn = {0, 1, 2, 3, 4, 5, 6, 7};
  if (shape == Shape::Tetrahedron) {
    std::sort(turn.begin(), turn.begin() + 4,
              [&](std::int8_t a, std::int8_t b) { return numbers[std::size_t(a)] < numbers[std::size_t(b)]; });
    int swaps = 0;
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = a + 1; b < 4; ++b) swaps += turn[a] > turn[b] ? 1 : 0;
    if (swaps % 2 == 1) std::swap(turn[0], turn[1]);
  } else if (shape == Shape::Prism) {
    // The edge from 1 to 4 must have the largest numbers.
    const auto largest = std::max_element(numbers.begin(), numbers.begin() + 3) - numbers.begin();
    for (std::size_t k = 0; k < 3; ++k) {
      turn[k] = std::int8_t((k + 2 + std::size_t(largest)) % 3);
      turn[k + 3] = std::int8_t(turn[k] + 3);
    }
  }
  return turn;
}

const std::vector<int>& nektar_turned_nodes(Shape shape, int order, const std::array<std::int8_t, 8>& turn) {
  static reference::Cache<std::tuple<Shape, int, std::array<std::int8_t, 8>>, std::vector<int>> cache;
  return cache.get({shape, order, turn}, [&] {
    // Every position is where its weights of the vertices put it: the weights of vertex v are now those of turn[v].
    const std::vector<int>& by_position = nodes_by_position(shape, order);
    const auto& lattice = reference::lattice(shape, order);
    const auto side = std::size_t(order) + 1;
    std::vector<int> turned;
    for (const auto& [i, j, k] : lattice) {
      const bool solid = shape == Shape::Tetrahedron;
      std::array<int, 4> weight = {order - i - j - (solid ? k : 0), i, j, solid ? k : 0}, moved{};
      for (std::size_t v = 0; v < (solid ? 4U : 3U); ++v) moved[std::size_t(turn[v])] = weight[v];
      const std::array at = {moved[1], moved[2], solid ? moved[3] : int(k)};
      const bool turns = solid || shape == Shape::Prism;
      turned.push_back(turns ? by_position[std::size_t(at[0]) + side * (std::size_t(at[1]) + side * std::size_t(at[2]))]
                             : int(turned.size()));
    }
    return turned;
  });
}

NektarFaceCorners::NektarFaceCorners(Shape shape, std::size_t f, std::span<const std::int32_t> cell) {
  static const auto same = [] {
    std::array<std::array<std::int8_t, 6>, kShapes> all{};
    for (int s = int(Shape::Tetrahedron); s < kShapes; ++s)
      all[std::size_t(s)] = same_sides(faces_of(Sides::Mfem, Shape(s)), faces_of(Sides::Nektar, Shape(s)));
    return all;
  }();
  const reference::Facet& face = faces_of(Sides::Nektar, shape)[std::size_t(same[std::size_t(shape)][f])];
  count = std::size_t(corners_of(face));
  for (std::size_t v = 0; v < count; ++v) vertices[v] = cell[std::size_t(face.vertices[v])];
  if (count == 3) std::sort(vertices.begin(), vertices.begin() + 3);
}

NektarGrid::NektarGrid(const HighOrderMesh& of, std::vector<std::int32_t> vertices, const Team& team)
    : mesh(of),
      cells(of, of.dimension),
      number_(std::move(vertices)),
      topology_(of.dimension, of.order,
                std::int32_t(std::count_if(number_.begin(), number_.end(), [](std::int32_t n) { return n >= 0; })),
                topology_cells(cells, [&](Shape shape, auto nodes) { return vertices_of(shape, nodes); }), team) {
  std::int64_t points = topology_.interior_first();
  for (const Cells::Range& range : cells.ranges()) {
    if (mesh.dimension > 2) break;
    interior_.push_back(std::int32_t(points));
    points += std::int64_t(range.block->size()) * inner_node_count(range.block->shape, mesh.order);
  }
  point_.resize(std::size_t(points));
  for (std::size_t node = 0; node < number_.size(); ++node)
    if (number_[node] >= 0) point_[std::size_t(number_[node])] = std::int32_t(node);
  team.for_ranges(cells.count(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    NektarTurnedNodes known(mesh.order);
    for (std::size_t cell = begin; cell < end; ++cell) place_points(cell, cells.shape(cell), cells.nodes(cell), known);
  });
}

NektarGrid::Turned NektarGrid::turned(Shape shape, std::span<const std::int32_t> nodes,
                                      NektarTurnedNodes& known) const {
  Turned cell;
  const auto count = std::size_t(reference::info(shape).vertices);
  for (std::size_t v = 0; v < count; ++v) cell.own[v] = number_[std::size_t(nodes[v])];
  cell.turn = nektar_turn(shape, {cell.own.data(), count});
  cell.place = &known.of(shape, cell.turn);
  return cell;
}

std::optional<std::size_t> NektarGrid::unshared_side(const Team& team) const {
  const auto first = std::int32_t(topology_.vertex_count()), end = std::int32_t(topology_.interior_first());
  if (first == end) return std::nullopt;
  SmallestCell found;
  team.for_ranges(cells.count(), kCellsPerTask, [&](std::size_t begin, std::size_t stop) {
    NektarTurnedNodes known(mesh.order);
    std::vector<std::int32_t> points;
    for_cells(begin, stop, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> vertices) {
      const std::span<const std::int32_t> nodes = cells.nodes(cell);
      const std::vector<int>& place = *turned(shape, nodes, known).place;
      points.resize(nodes.size());
      points_of(shape, vertices, end, points);
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i] < first || points[i] >= end) continue;
        if (!are_at_one_place(mesh, nodes[std::size_t(place[i])], point_[std::size_t(points[i])])) found.take(cell);
      }
    });
  });
  return found.get();
}

void NektarGrid::place_points(std::size_t cell, Shape shape, std::span<const std::int32_t> nodes,
                              NektarTurnedNodes& known) {
  const Turned cell_turned = turned(shape, nodes, known);
  const auto& own = cell_turned.own;
  const auto& turn = cell_turned.turn;
  const std::vector<int>& place = *cell_turned.place;
  const MfemLocalNodes& local = mfem_local_nodes(shape, mesh.order);
  const auto put = [&](std::size_t point, int at) { point_[point] = nodes[std::size_t(place[std::size_t(at)])]; };
  const auto edges = edges_of(Sides::Mfem, shape);
  std::size_t next = vertex_count() + std::size_t(topology_.edges_before(cell)) * std::size_t(mesh.order - 1);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (!topology_.is_first_edge(cell, e)) continue;
    const auto vertex = [&](std::int8_t v) { return own[std::size_t(turn[std::size_t(v)])]; };
    const std::vector<int>& inner = local.edges[e];
    const bool rises = vertex(edges[e][0]) < vertex(edges[e][1]);
    for (std::size_t i = 0; i < inner.size(); ++i) put(next++, rises ? inner[i] : inner[inner.size() - 1 - i]);
  }
  if (mesh.dimension == 2) {
    next = std::size_t(interior(cell));
    for (std::size_t i = nodes.size() - std::size_t(inner_node_count(shape, mesh.order)); i < nodes.size(); ++i)
      point_[next++] = nodes[i];
    return;
  }
  next = std::size_t(topology_.face_first(topology_.faces_before(cell)));
  for (std::size_t f = 0; f < local.faces.size(); ++f)
    if (topology_.is_first_face(cell, f))
      for (const int at : local.faces[f][0]) put(next++, at);
}

std::int32_t NektarGrid::interior(std::size_t cell) const {
  if (interior_.empty()) return 0;
  const Cells::Range& range = cells.range_of(cell);
  return interior_[std::size_t(&range - cells.ranges().data())] +
         std::int32_t(cell - range.first) * inner_node_count(range.block->shape, mesh.order);
}

NektarSides NektarGrid::edges_around(std::span<const std::int32_t> vertices) const {
  NektarSides found;
  for (std::size_t v = 0; v < vertices.size(); ++v)
    found.numbers[found.count++] = topology_.edge(vertices[v], vertices[(v + 1) % vertices.size()]);
  return found;
}

NektarSides NektarGrid::sides(Shape shape, std::span<const std::int32_t> vertices) const {
  if (mesh.dimension == 2) return edges_around(vertices);
  NektarSides found;
  for (const reference::Facet& face : faces_of(Sides::Nektar, shape)) {
    std::array<std::int32_t, 4> corners{};
    const auto count = std::size_t(corners_of(face));
    for (std::size_t v = 0; v < count; ++v) corners[v] = vertices[std::size_t(face.vertices[v])];
    found.numbers[found.count++] = topology_.face({corners.data(), count});
  }
  return found;
}

std::int32_t NektarGrid::side(Shape shape, std::span<const std::int32_t> nodes) const {
  std::array<std::int32_t, 4> corners{};
  const auto count = std::size_t(reference::info(shape).vertices);
  for (std::size_t v = 0; v < count; ++v)
    if ((corners[v] = number_[std::size_t(nodes[v])]) < 0) return -1;
  return shape == Shape::Line ? topology_.edge(corners[0], corners[1]) : topology_.face({corners.data(), count});
}

bool NektarGrid::has_file_order() const {
  for (std::size_t i = 0; i < std::size_t(topology_.interior_first()); ++i)
    if (point_[i] != std::int32_t(i)) return false;
  return true;
}

}  // namespace varimesh::formats
