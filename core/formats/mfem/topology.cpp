#include "core/formats/mfem/topology.h"

#include <algorithm>
#include <string>

#include "core/formats/numbering/node_order.h"
#include "core/reference/cache.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

using reference::Facet;

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
  for (const auto& [a, b] : edges_of(Sides::Mfem, shape)) {
    Positions list;
    add_edge(list, vertex(a), vertex(b), order);
    local.edges.push_back(numbers(list));
  }
  for (const Facet& face : faces_of(Sides::Mfem, shape)) {
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

int inner_nodes(Shape shape, int order) {
  return shape == Shape::Triangle ? (order - 1) * (order - 2) / 2 : (order - 1) * (order - 1);
}

}  // namespace

const MfemLocalNodes& mfem_local_nodes(Shape shape, int order) {
  static reference::Cache<std::array<int, 2>, MfemLocalNodes> cache;
  return cache.get({int(shape), order}, [&] { return make_local_nodes(shape, order); });
}

// === The mesh's degrees of freedom =======================================================================

namespace {

/// The turn of a face matters if it has two nodes or more.
Topology::Faces faces_of(int dimension, int order) {
  if (dimension < 3) return Topology::Faces::None;
  return inner_nodes(Shape::Triangle, order) > 1 || inner_nodes(Shape::Quadrilateral, order) > 1
             ? Topology::Faces::Turned
             : Topology::Faces::Numbered;
}

/// The cells, after a check of their number.
const TopologyCells& checked(const TopologyCells& cells, const Scanner* counted) {
  if (counted != nullptr && cells.count > Topology::kMostTopologyCells)
    counted->fail("the mesh has " + std::to_string(cells.count) + " elements, more than VariMesh takes");
  return cells;
}

CountMemory memory_of(const Scanner* counted) {
  if (counted == nullptr) return {};
  return [counted](std::int64_t bytes) {
    if (bytes >= 0)
      counted->take_memory(std::size_t(bytes));
    else if (counted->allowance != nullptr)
      counted->allowance->give_back(std::size_t(-bytes));
  };
}

}  // namespace

MfemTopology::MfemTopology(int dimension, int order, std::int32_t vertices, const TopologyCells& cells,
                           const Team& team, const Scanner* counted)
    : Topology(kMfemParts, faces_of(dimension, order), vertices, checked(cells, counted), team, memory_of(counted)),
      order_(order) {
  for (int shape = int(Shape::Line); shape < kShapes; ++shape)
    local_[std::size_t(shape)] = &mfem_local_nodes(Shape(shape), order_);
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
  const auto edges = edges_of(Sides::Mfem, shape);
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
  const int dimension = reference::info(shape).dimension;
  const bool searched = dimension < 3 || filled < nodes.size();
  if (has_faces() && searched) {
    const auto faces = faces_of(Sides::Mfem, shape);
    for (std::size_t f = 0; f < faces.size(); ++f) {
      std::array<std::int32_t, 4> own{};
      const auto corners = std::size_t(reference::info(faces[f].shape).vertices);
      for (std::size_t v = 0; v < corners; ++v) own[v] = vertices[std::size_t(faces[f].vertices[v])];
      const FaceAt at = find_face({own.data(), corners});
      if (at.number < 0) return false;
      std::int32_t next = std::int32_t(face_first(at.number));
      const std::vector<int>& inner = local.faces[f][2 * at.corner + (at.forward ? 0 : 1)];
      for (const int node : inner) nodes[std::size_t(node)] = next++;
      filled += inner.size();
    }
  }
  if (dimension == (has_faces() ? 3 : 2))
    for (; filled < nodes.size(); ++filled) nodes[filled] = interior++;
  return true;
}

}  // namespace varimesh::formats
