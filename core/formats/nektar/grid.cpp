#include "core/formats/nektar/grid.h"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <queue>

#include "core/formats/mfem/space.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/node_order.h"
#include "core/reference/cache.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

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

}  // namespace

Expected<std::vector<std::int32_t>> nektar_vertices(const HighOrderMesh& mesh) {
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

std::vector<int> nektar_turned_nodes(Shape shape, int order, std::span<const std::int32_t> nodes,
                                     const std::vector<std::int32_t>& numbers) {
  std::array<std::int32_t, 8> own{};
  const auto count = std::size_t(reference::info(shape).vertices);
  for (std::size_t v = 0; v < count; ++v) own[v] = numbers[std::size_t(nodes[v])];
  const auto turn = nektar_turn(shape, {own.data(), count});
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

NektarGrid::NektarGrid(const HighOrderMesh& of, std::vector<std::int32_t> vertices, const Team& team)
    : mesh(of),
      number_(std::move(vertices)),
      topology_(
          of.dimension, of.order,
          std::int32_t(std::count_if(number_.begin(), number_.end(), [](std::int32_t n) { return n >= 0; })),
          mfem_cells(Cells(mesh, mesh.dimension), [&](Shape shape, auto nodes) { return vertices_of(shape, nodes); }),
          team) {
  vertex_nodes.resize(std::size_t(topology_.vertex_count()));
  for (std::size_t node = 0; node < number_.size(); ++node)
    if (number_[node] >= 0) vertex_nodes[std::size_t(number_[node])] = std::int32_t(node);
  const auto numbers_of = [&](std::span<const std::int32_t> nodes, Shape shape) {
    std::vector<std::int32_t> own;
    for (std::size_t v = 0; v < std::size_t(reference::info(shape).vertices); ++v)
      own.push_back(number_[std::size_t(nodes[v])]);
    return own;
  };
  edges.resize(std::size_t(topology_.edge_count()));
  faces.resize(mesh.dimension == 3 ? std::size_t(topology_.face_count()) : 0);
  std::int64_t nodes = topology_.interior_first();
  node_of_.resize(std::size_t(nodes));
  std::vector<std::int32_t> dofs;
  for_each_cell([&](std::size_t, const ElementBlock& block, std::span<const std::int32_t> own,
                    std::span<const std::int32_t> turned) {
    dofs.resize(own.size());
    (void)topology_.find_nodes(block.shape, numbers_of(own, block.shape), std::int32_t(nodes), dofs);
    for (std::size_t i = 0; i < own.size(); ++i)
      if (dofs[i] < std::int32_t(node_of_.size())) node_of_[std::size_t(dofs[i])] = own[i];
    for (const auto& [a, b] : reference::info(block.shape).edges) {
      const std::int32_t low = std::min(turned[std::size_t(a)], turned[std::size_t(b)]);
      const std::int32_t high = std::max(turned[std::size_t(a)], turned[std::size_t(b)]);
      edges[std::size_t(topology_.edge(low, high))] = {low, high};
    }
    for (const reference::Facet& face : nektar_faces(block.shape)) {
      const auto count = std::size_t(reference::info(face.shape).vertices);
      std::array<std::int32_t, 4> corners = {-1, -1, -1, -1};
      for (std::size_t v = 0; v < count; ++v) corners[v] = turned[std::size_t(face.vertices[v])];
      if (count == 3) std::sort(corners.begin(), corners.begin() + 3);
      auto& known = faces[std::size_t(topology_.face({corners.data(), count}))];
      if (known[0] == known[1]) known = corners;  // the first cell decides
    }
  });
}

std::vector<std::int64_t> NektarGrid::edges_around(std::span<const std::int32_t> vertices) const {
  std::vector<std::int64_t> found;
  for (std::size_t v = 0; v < vertices.size(); ++v)
    found.push_back(topology_.edge(vertices[v], vertices[(v + 1) % vertices.size()]));
  return found;
}

std::vector<std::int64_t> NektarGrid::sides(Shape shape, std::span<const std::int32_t> vertices) const {
  if (mesh.dimension == 2) return edges_around(vertices);
  std::vector<std::int64_t> found;
  for (const reference::Facet& face : nektar_faces(shape)) {
    std::array<std::int32_t, 4> corners{};
    const auto count = std::size_t(reference::info(face.shape).vertices);
    for (std::size_t v = 0; v < count; ++v) corners[v] = vertices[std::size_t(face.vertices[v])];
    found.push_back(topology_.face({corners.data(), count}));
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
  for (std::size_t i = 0; i < node_of_.size(); ++i)
    if (node_of_[i] != std::int32_t(i)) return false;
  return true;
}

std::vector<std::int32_t> NektarGrid::nodes_of(Shape shape, std::span<const std::int32_t> vertices) const {
  std::vector<std::int32_t> nodes(std::size_t(reference::node_count(shape, mesh.order)));
  [[maybe_unused]] const bool found = topology_.find_nodes(shape, vertices, 0, nodes);
  assert(found);
  for (std::int32_t& node : nodes) node = node_of_[std::size_t(node)];
  return nodes;
}

}  // namespace varimesh::formats
