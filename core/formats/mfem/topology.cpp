#include "core/formats/mfem/topology.h"

#include <algorithm>
#include <bit>
#include <cassert>

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

/// The vertices of a face, ascending, two in each number; those of a triangle begin with −1. Without branches, because
/// this is done for every face of every cell, and for those in the same bucket.
struct FaceKey {
  std::uint64_t low, high;
  friend bool operator==(const FaceKey&, const FaceKey&) = default;
};

std::uint64_t packed(std::int32_t a, std::int32_t b) {
  return std::uint64_t(std::uint32_t(a)) << 32 | std::uint32_t(b);
}

FaceKey key_of(const std::array<std::int32_t, 4>& vertices) {
  auto [a, b, c, d] = vertices;
  const auto order = [](std::int32_t& x, std::int32_t& y) {
    const std::int32_t low = std::min(x, y);
    y = std::max(x, y);
    x = low;
  };
  order(a, b), order(c, d), order(a, c), order(b, d), order(b, c);
  return {packed(a, b), packed(c, d)};
}

FaceKey key_of(std::span<const std::int32_t> vertices) {
  std::array<std::int32_t, 4> own{-1, -1, -1, -1};
  for (std::size_t v = 0; v < vertices.size(); ++v) own[v] = vertices[v];
  return key_of(own);
}

/// The bucket of two numbers in a table whose size is a power of two. The first multiplier is 2⁶⁴ divided by the golden
/// ratio (D. E. Knuth, The Art of Computer Programming, volume 3, section 6.4); the second is another odd number.
std::size_t bucket_of(std::uint64_t low, std::uint64_t high, std::size_t buckets) {
  const std::uint64_t hash = (low * 0x9e3779b97f4a7c15U + high) * 0xd1342543de82ef95U;
  return (hash ^ hash >> 32) & (buckets - 1);
}

std::size_t bucket_of(const std::array<std::int32_t, 2>& edge, std::size_t buckets) {
  return bucket_of(packed(edge[0], edge[1]), 0, buckets);
}
std::size_t bucket_of(const FaceKey& key, std::size_t buckets) { return bucket_of(key.low, key.high, buckets); }

int inner_nodes(Shape shape, int order) {
  return shape == Shape::Triangle ? (order - 1) * (order - 2) / 2 : (order - 1) * (order - 1);
}

}  // namespace

const MfemLocalNodes& mfem_local_nodes(Shape shape, int order) {
  static reference::Cache<std::array<int, 2>, MfemLocalNodes> cache;
  return cache.get({int(shape), order}, [&] { return make_local_nodes(shape, order); });
}

// === The mesh's edges and faces ==========================================================================

MfemTopology::MfemTopology(int dimension, int order, std::int32_t vertices, const Scanner* counted)
    : dimension_(dimension), order_(order), vertices_(vertices), counted_(counted) {
  // A mesh has about 3 to 7 edges and up to 12 faces per vertex.
  const std::size_t edges = std::bit_ceil(4 * std::size_t(vertices) + 1), faces = dimension == 3 ? 2 * edges : 0;
  if (counted_ != nullptr) counted_->take_memory((edges + faces) * sizeof edge_buckets_[0]);
  edge_buckets_.assign(edges, -1);
  face_buckets_.assign(faces, -1);
}

std::int32_t MfemTopology::edge(std::int32_t a, std::int32_t b) const {
  const std::array<std::int32_t, 2> key{std::min(a, b), std::max(a, b)};
  std::int32_t e = edge_buckets_[bucket_of(key, edge_buckets_.size())];
  while (e >= 0 && edges_[std::size_t(e)].vertices != key) e = edges_[std::size_t(e)].next;
  return e;
}

std::int32_t MfemTopology::face(std::span<const std::int32_t> vertices) const {
  const FaceKey key = key_of(vertices);
  std::int32_t f = face_buckets_[bucket_of(key, face_buckets_.size())];
  while (f >= 0 && key_of(faces_[std::size_t(f)].vertices) != key) f = faces_[std::size_t(f)].next;
  return f;
}

void MfemTopology::add(Shape shape, std::span<const std::int32_t> vertices) {
  for (const auto& [a, b] : mfem_edges(shape)) {
    const auto [low, high] = std::minmax(vertices[std::size_t(a)], vertices[std::size_t(b)]);
    if (edge(low, high) >= 0) continue;
    const std::array<std::int32_t, 2> key{low, high};
    std::int32_t& head = edge_buckets_[bucket_of(key, edge_buckets_.size())];
    if (counted_ != nullptr) counted_->make_room(edges_);
    edges_.push_back({key, head});
    head = std::int32_t(edges_.size()) - 1;
  }
  if (dimension_ < 3) return;
  for (const Facet& facet : mfem_faces(shape)) {
    Face fresh{{-1, -1, -1, -1}, -1};
    const auto count = std::size_t(reference::info(facet.shape).vertices);
    for (std::size_t v = 0; v < count; ++v) fresh.vertices[v] = vertices[std::size_t(facet.vertices[v])];
    if (face({fresh.vertices.data(), count}) >= 0) continue;
    std::int32_t& head = face_buckets_[bucket_of(key_of(fresh.vertices), face_buckets_.size())];
    fresh.next = head;
    head = std::int32_t(faces_.size());
    triangles_ += facet.shape == Shape::Triangle ? 1 : 0;
    if (counted_ != nullptr) counted_->make_room(faces_);
    faces_.push_back(fresh);
  }
}

std::int64_t MfemTopology::face_first(std::int64_t face) const {
  const std::int64_t first = vertex_count() + edge_count() * (order_ - 1);
  if (face_first_.empty())
    return first + face * inner_nodes(triangles_ > 0 ? Shape::Triangle : Shape::Quadrilateral, order_);
  return first + face_first_[std::size_t(face)];
}

void MfemTopology::finish() {
  for (int shape = int(Shape::Line); shape < kShapes; ++shape)
    local_[std::size_t(shape)] = &mfem_local_nodes(Shape(shape), order_);
  if (triangles_ == 0 || triangles_ == face_count()) return;
  if (counted_ != nullptr) counted_->take_memory((faces_.size() + 1) * sizeof face_first_[0]);
  face_first_.reserve(faces_.size() + 1);
  std::int64_t first = 0;
  for (const Face& face : faces_) {
    face_first_.push_back(first);
    first += inner_nodes(face.vertices[3] < 0 ? Shape::Triangle : Shape::Quadrilateral, order_);
  }
  face_first_.push_back(first);
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
  if (dimension_ == 3) {
    const auto faces = mfem_faces(shape);
    for (std::size_t f = 0; f < faces.size(); ++f) {
      const auto count = std::size_t(reference::info(faces[f].shape).vertices);
      std::array<std::int32_t, 4> own{};
      for (std::size_t v = 0; v < count; ++v) own[v] = vertices[std::size_t(faces[f].vertices[v])];
      const std::int32_t number = face({own.data(), count});
      if (number < 0) return false;
      const auto& base = faces_[std::size_t(number)].vertices;
      const auto corner =
          std::size_t(std::find(own.begin(), own.begin() + std::ptrdiff_t(count), base[0]) - own.begin());
      if (corner == count) return false;
      const bool forward = own[(corner + 1) % count] == base[1];
      if (!forward && own[(corner + count - 1) % count] != base[1]) return false;
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
