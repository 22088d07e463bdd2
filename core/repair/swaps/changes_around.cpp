#include "core/repair/swaps/changes_around.h"

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "core/base/index.h"
#include "core/repair/mean_ratio.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

/// An edge with more tetrahedra around it has too many triangulations, and none of them is good.
constexpr std::size_t kMostAround = 7;

VertexNodes replaced(VertexNodes vertices, std::int32_t from, std::int32_t to) {
  std::ranges::replace(vertices, from, to);
  return vertices;
}

bool has(const VertexNodes& vertices, std::int32_t vertex) {
  return std::ranges::find(vertices, vertex) != vertices.end();
}

/// All triangulations of a polygon with corners first … last of a ring: lists of three corners each.
using Triangle = std::array<std::size_t, 3>;
std::vector<std::vector<Triangle>> triangulations(std::size_t first, std::size_t last) {
  if (last - first < 2) return {{}};
  std::vector<std::vector<Triangle>> result;
  for (std::size_t middle = first + 1; middle < last; ++middle)
    for (const auto& left : triangulations(first, middle))
      for (const auto& right : triangulations(middle, last)) {
        std::vector<Triangle>& all = result.emplace_back(left);
        all.insert(all.end(), right.begin(), right.end());
        all.push_back({first, middle, last});
      }
  return result;
}

class Finder {
 public:
  explicit Finder(const CellPatch& patch)
      : patch_(patch),
        cells_(patch.mesh, patch.mesh.dimension),
        sign_(detail::orientation(patch.mesh)),
        of_vertex_(patch.in_whole.size()) {
    for (std::size_t c = 0; c < cells_.count(); ++c) {
      vertices_.push_back(vertices_of(c));
      for (const std::int32_t vertex : vertices_.back())
        if (vertex >= 0) of_vertex_[at(vertex)].push_back(static_cast<std::int32_t>(c));
    }
  }

  std::vector<CellChange> around(std::int32_t cell) {
    const VertexNodes& own = vertices_[at(cell)];
    if (cells_.shape(at(cell)) == Shape::Triangle) {
      for (std::size_t k = 0; k < 3; ++k) swap_diagonal(cell, own[k], own[(k + 1) % 3]);
    } else if (cells_.shape(at(cell)) == Shape::Tetrahedron) {
      for (const std::int32_t apex : own) swap_face(cell, apex);
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = i + 1; j < 4; ++j) remove_edge(cell, i, j);
    } else {
      return {};
    }
    for (const std::int32_t vertex : own)
      if (vertex >= 0) collapse(vertex);
    std::ranges::stable_sort(found_, std::ranges::greater{}, &std::pair<double, CellChange>::first);
    std::vector<CellChange> result;
    for (auto& [quality, change] : found_) result.push_back(std::move(change));
    return result;
  }

 private:
  VertexNodes vertices_of(std::size_t cell) const {
    VertexNodes result{-1, -1, -1, -1};
    const auto count = at(reference::info(cells_.shape(cell)).vertices);
    if (count <= 4) std::ranges::copy(cells_.nodes(cell).first(count), result.begin());
    return result;
  }

  /// The cells that have all these vertices, in ascending order.
  std::vector<std::int32_t> cells_with(std::span<const std::int32_t> vertices) const {
    std::vector<std::int32_t> result;
    for (const std::int32_t cell : of_vertex_[at(vertices[0])])
      if (std::ranges::all_of(vertices, [&](std::int32_t v) { return has(vertices_[at(cell)], v); }))
        result.push_back(cell);
    return result;
  }

  // ===== changes =====

  void swap_diagonal(std::int32_t cell, std::int32_t a, std::int32_t b) {
    if (patch_.kept.contains(edge_place(a, b))) return;
    const std::vector<std::int32_t> both = cells_with(std::array{a, b});
    if (both.size() != 2) return;
    const VertexNodes& other = vertices_[at(both[0] == cell ? both[1] : both[0])];
    const std::int32_t opposite = *std::ranges::find_if(other, [&](std::int32_t v) { return v != a && v != b; });
    const VertexNodes& own = vertices_[at(cell)];
    offer({RepairStep::Kind::Swapped,
           {std::min(a, b), std::max(a, b)},
           both,
           {replaced(own, b, opposite), replaced(own, a, opposite)}});
  }

  /// The face opposite `apex` becomes the edge from `apex` to the vertex on its other side.
  void swap_face(std::int32_t cell, std::int32_t apex) {
    const VertexNodes& own = vertices_[at(cell)];
    std::vector<std::int32_t> face;
    std::ranges::copy_if(own, std::back_inserter(face), [&](std::int32_t v) { return v != apex; });
    std::ranges::sort(face);
    if (patch_.kept.contains(face_place(face[0], face[1], face[2]))) return;
    const std::vector<std::int32_t> both = cells_with(face);
    if (both.size() != 2) return;
    const VertexNodes& other = vertices_[at(both[0] == cell ? both[1] : both[0])];
    const std::int32_t opposite =
        *std::ranges::find_if(other, [&](std::int32_t v) { return std::ranges::find(face, v) == face.end(); });
    CellChange change{RepairStep::Kind::Swapped, face, both, {}};
    for (const std::int32_t vertex : face) change.added.push_back(replaced(own, vertex, opposite));
    offer(std::move(change));
  }

  /// The vertices around an edge, in the direction in which (a, b, ring[k], ring[k + 1]) has the cells' orientation;
  /// nothing if the ring is not closed or too long. `around` are the cells of the edge.
  std::optional<std::vector<std::int32_t>> ring_around(const std::vector<std::int32_t>& around, std::int32_t cell,
                                                       std::size_t i, std::size_t j) const {
    const VertexNodes& own = vertices_[at(cell)];
    std::array<std::size_t, 2> rest{};
    std::size_t count = 0;
    for (std::size_t k = 0; k < 4; ++k)
      if (k != i && k != j) rest[count++] = k;
    // (i, j, rest[0], rest[1]) is an even permutation of (0, 1, 2, 3) if it has an even number of inversions. i < j.
    const std::size_t inversions = i + (j - 1);
    if (inversions % 2 == 1) std::swap(rest[0], rest[1]);
    std::vector<std::int32_t> ring{own[rest[0]], own[rest[1]]};
    std::int32_t last = cell;
    for (;;) {
      const auto next = std::ranges::find_if(
          around, [&](std::int32_t other) { return other != last && has(vertices_[at(other)], ring.back()); });
      if (next == around.end()) return std::nullopt;
      last = *next;
      const VertexNodes& vertices = vertices_[at(last)];
      const std::int32_t vertex = *std::ranges::find_if(
          vertices, [&](std::int32_t v) { return v != own[i] && v != own[j] && v != ring.back(); });
      if (vertex == ring.front()) break;
      ring.push_back(vertex);
      if (ring.size() > around.size()) return std::nullopt;
    }
    if (ring.size() != around.size()) return std::nullopt;
    return ring;
  }

  void remove_edge(std::int32_t cell, std::size_t i, std::size_t j) {
    const std::int32_t a = vertices_[at(cell)][i], b = vertices_[at(cell)][j];
    if (patch_.kept.contains(edge_place(a, b))) return;
    const std::vector<std::int32_t> around = cells_with(std::array{a, b});
    if (around.size() < 3 || around.size() > kMostAround) return;
    const auto found = ring_around(around, cell, i, j);
    if (!found) return;
    const std::vector<std::int32_t>& ring = *found;
    for (const std::vector<Triangle>& triangles : triangulations(0, ring.size() - 1)) {
      CellChange change{RepairStep::Kind::Swapped, {std::min(a, b), std::max(a, b)}, around, {}};
      for (const auto& [p, q, r] : triangles) {
        change.added.push_back({a, ring[p], ring[q], ring[r]});
        change.added.push_back({b, ring[p], ring[r], ring[q]});
      }
      offer(std::move(change));
    }
  }

  /// The vertex goes to the other end of each of its edges.
  void collapse(std::int32_t vertex) {
    if (patch_.fixed[at(vertex)]) return;
    const std::vector<std::int32_t> star = cells_with(std::array{vertex});
    std::set<std::int32_t> neighbours;
    for (const std::int32_t cell : star)
      for (const std::int32_t other : vertices_[at(cell)])
        if (other >= 0 && other != vertex) neighbours.insert(other);
    for (const std::int32_t other : neighbours)
      if (patch_.kept.contains(edge_place(vertex, other))) return;
    for (const std::int32_t other : neighbours) {
      CellChange change{RepairStep::Kind::Collapsed, {vertex, other}, star, {}};
      for (const std::int32_t cell : star)
        if (!has(vertices_[at(cell)], other)) change.added.push_back(replaced(vertices_[at(cell)], vertex, other));
      offer(std::move(change));
    }
  }

  // ===== which are possible =====

  void offer(CellChange change) {
    if (change.added.empty() || !is_of_one_block(change) || !fills_the_room(change)) return;
    double smallest = std::numeric_limits<double>::infinity();
    for (const VertexNodes& vertices : change.added) smallest = std::min(smallest, ratio(vertices));
    found_.emplace_back(smallest, std::move(change));
  }

  bool is_of_one_block(const CellChange& change) const {
    const ElementBlock* const block = cells_.range_of(at(change.removed.front())).block;
    return std::ranges::all_of(change.removed,
                               [&](std::int32_t cell) { return cells_.range_of(at(cell)).block == block; });
  }

  using Places = std::map<SplitPlace, int>;

  /// How many of the cells have each facet.
  Places facets_of(std::span<const VertexNodes> cells) const {
    Places result;
    for (const VertexNodes& v : cells) {
      if (v[3] < 0) {
        for (std::size_t k = 0; k < 3; ++k) ++result[edge_place(v[k], v[(k + 1) % 3])];
      } else {
        for (std::size_t k = 0; k < 4; ++k) ++result[face_place(v[k], v[(k + 1) % 4], v[(k + 2) % 4])];
      }
    }
    return result;
  }

  static std::set<SplitPlace> edges_of(std::span<const VertexNodes> cells) {
    std::set<SplitPlace> result;
    for (const VertexNodes& v : cells)
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = i + 1; j < 4; ++j)
          if (v[i] >= 0 && v[j] >= 0) result.insert(edge_place(v[i], v[j]));
    return result;
  }

  /// Whether the new cells have the facets of the old ones outside, two cells at each facet inside, and no edge that
  /// other cells have and the old ones had not.
  bool fills_the_room(const CellChange& change) const {
    std::vector<VertexNodes> old;
    for (const std::int32_t cell : change.removed) old.push_back(vertices_[at(cell)]);
    Places outside = facets_of(old);
    for (const auto& [facet, count] : facets_of(change.added)) {
      if (count > 2) return false;
      const auto found = outside.find(facet);
      const bool was_outside = found != outside.end() && found->second == 1;
      if ((count == 1) != was_outside) return false;
      if (was_outside)
        outside.erase(found);
      else if (!only_in(change.removed, std::span(facet).first(at(vertex_count(facet)))))
        return false;
    }
    if (std::ranges::any_of(outside, [](const auto& entry) { return entry.second == 1; })) return false;
    const std::set<SplitPlace> known = edges_of(old);
    for (const SplitPlace& edge : edges_of(change.added)) {
      if (known.contains(edge)) continue;
      if (patch_.shared[at(edge[0])] && patch_.shared[at(edge[1])]) return false;  // it may exist outside
      if (!only_in(change.removed, std::span(edge).first(2))) return false;
    }
    return true;
  }

  /// Whether only these cells have all these vertices.
  bool only_in(const std::vector<std::int32_t>& cells, std::span<const std::int32_t> vertices) const {
    return std::ranges::all_of(cells_with(vertices),
                               [&](std::int32_t cell) { return std::ranges::binary_search(cells, cell); });
  }

  /// The mean ratio of the straight-sided cell, positive in the orientation of the mesh.
  double ratio(const VertexNodes& vertices) const {
    Eigen::Matrix<double, Eigen::Dynamic, 3> x(vertices[3] < 0 ? 3 : 4, 3);
    for (Eigen::Index v = 0; v < x.rows(); ++v)
      for (Eigen::Index c = 0; c < 3; ++c) x(v, c) = patch_.mesh.coordinates[3 * at(vertices[at(v)]) + at(c)];
    return sign_ * mean_ratio(x);
  }

  const CellPatch& patch_;
  Cells cells_;
  double sign_;
  std::vector<VertexNodes> vertices_;                 // by cell; −1 for cells that are no simplices
  std::vector<std::vector<std::int32_t>> of_vertex_;  // the cells of each vertex, ascending
  std::vector<std::pair<double, CellChange>> found_;
};

}  // namespace

std::vector<CellChange> changes_around(const CellPatch& patch, std::int32_t cell) { return Finder(patch).around(cell); }

}  // namespace varimesh
