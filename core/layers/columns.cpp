#include "core/layers/columns.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// Facets of a wall bend by less than this from one to the next: the cosine of 40°.
constexpr double kSmooth = 0.766;
/// An edge points on if its angle to the last edge of its column has at least this cosine: 37°.
constexpr double kOn = 0.8;
/// The first edge is short, so that it cannot be confused with another. It may lean: layers are not always made along
/// normals.
constexpr double kOffTheWall = 0.3;
/// With Walls::All a column ends where the next cell is lower than this times the one below: there it would go down the
/// layers of the wall on the other side.
constexpr double kShrinks = 0.8;
/// On the way down through the layers of another wall the second cell is lower than this times the first one.
constexpr double kGoesDown = 0.95;
/// A facet is curved if a node lies this far above the straight facet, relative to the length of its shortest edge.
/// Nodes that are spaced unevenly in a straight facet do not curve it.
constexpr double kCurved = 1e-6;

Vector mean_vertex(const HighOrderMesh& mesh, Shape shape, std::span<const std::int32_t> nodes) {
  Vector sum = Vector::Zero();
  const int count = reference::info(shape).vertices;
  for (int v = 0; v < count; ++v) sum += point(mesh, nodes[at(v)]);
  return sum / count;
}

/// The unit normal of the straight facet, to either side.
Vector normal_of(const HighOrderMesh& mesh, const WallFacet& facet) {
  const Vector a = point(mesh, facet.nodes[0]), b = point(mesh, facet.nodes[1]);
  if (facet.shape == Shape::Line) return Vector(a.y() - b.y(), b.x() - a.x(), 0).normalized();
  const std::size_t last = facet.shape == Shape::Triangle ? 2 : 3;
  const Vector c = point(mesh, facet.nodes[2]), d = point(mesh, facet.nodes[last]);
  return last == 2 ? Vector((b - a).cross(c - a).normalized()) : Vector((c - a).cross(d - b).normalized());
}

bool is_curved(const HighOrderMesh& mesh, const WallFacet& facet, double size) {
  const reference::Points& nodes =
      reference::nodes(facet.shape, mesh.order, reference::NodeSet::Equispaced, mesh.dimension);
  const int vertices = reference::info(facet.shape).vertices;
  const Vector normal = normal_of(mesh, facet);
  for (std::size_t k = at(vertices); k < facet.nodes.size(); ++k) {
    Vector straight = Vector::Zero();
    const double u = (1 + nodes(static_cast<int>(k), 0)) / 2;
    const double v = facet.shape == Shape::Line ? 0 : (1 + nodes(static_cast<int>(k), 1)) / 2;
    if (facet.shape == Shape::Quadrilateral)
      straight = (1 - u) * (1 - v) * point(mesh, facet.nodes[0]) + u * (1 - v) * point(mesh, facet.nodes[1]) +
                 u * v * point(mesh, facet.nodes[2]) + (1 - u) * v * point(mesh, facet.nodes[3]);
    else
      straight = (1 - u - v) * point(mesh, facet.nodes[0]) + u * point(mesh, facet.nodes[1]) +
                 v * point(mesh, facet.nodes[facet.shape == Shape::Line ? 0 : 2]);
    if (std::abs(normal.dot(straight - point(mesh, facet.nodes[k]))) > kCurved * size) return true;
  }
  return false;
}

/// The facets of the boundary whose cell is low over them, with their cells.
std::vector<WallFacet> low_facets(const HighOrderMesh& mesh, const Facets& facets, const Cells& cells) {
  std::vector<WallFacet> low;
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const std::span<const std::int32_t> nodes = cells.nodes(cell);
    const reference::ShapeInfo& info = reference::info(cells.shape(cell));
    for (std::size_t f = 0; f < info.facets.size(); ++f) {
      if (facets.neighbour[at(facets.first[cell]) + f] >= 0) continue;
      WallFacet facet{info.facets[f].shape, static_cast<std::int32_t>(cell), {}};
      for (const int local : reference::facet_nodes(info.shape, mesh.order, static_cast<int>(f)))
        facet.nodes.push_back(nodes[at(local)]);
      const Vector normal = normal_of(mesh, facet), from = point(mesh, facet.nodes[0]);
      double height = 0;
      for (int v = 0; v < info.vertices; ++v)
        height = std::max(height, std::abs(normal.dot(point(mesh, nodes[at(v)]) - from)));
      const double size = shortest_edge(mesh, facet.shape, facet.nodes);
      facet.is_thin = height < kThin * size;
      if (height < kLow * size) low.push_back(std::move(facet));
    }
  }
  return low;
}

/// Sets of facets that hang together.
class Patches {
 public:
  explicit Patches(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }
  std::size_t of(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) { parent_[of(a)] = of(b); }

 private:
  std::vector<std::size_t> parent_;
};

/// The smooth patches of facets: they share edges or vertices, and bend little from one to the next.
Patches smooth_patches(const HighOrderMesh& mesh, std::span<const WallFacet> facets) {
  struct Side {
    std::array<std::int32_t, 2> vertices;
    std::size_t facet;
  };
  std::vector<Side> sides;
  for (std::size_t f = 0; f < facets.size(); ++f) {
    if (facets[f].shape == Shape::Line) {
      for (std::size_t v = 0; v < 2; ++v) sides.push_back({{facets[f].nodes[v], -1}, f});
      continue;
    }
    for (const auto& edge : reference::info(facets[f].shape).edges) {
      const auto [a, b] = std::minmax(facets[f].nodes[at(edge[0])], facets[f].nodes[at(edge[1])]);
      sides.push_back({{a, b}, f});
    }
  }
  std::ranges::stable_sort(sides, {}, &Side::vertices);
  Patches patches(facets.size());
  for (std::size_t i = 1; i < sides.size(); ++i) {
    if (sides[i].vertices != sides[i - 1].vertices) continue;
    const std::size_t a = sides[i - 1].facet, b = sides[i].facet;
    if (std::abs(normal_of(mesh, facets[a]).dot(normal_of(mesh, facets[b]))) > kSmooth) patches.join(a, b);
  }
  return patches;
}

/// Keeps the facets with `keep(patch, facet)`.
template <class Keep>
std::vector<WallFacet> kept(std::vector<WallFacet> facets, Patches& patches, const Keep& keep) {
  std::vector<WallFacet> left;
  for (std::size_t f = 0; f < facets.size(); ++f)
    if (keep(patches.of(f), facets[f])) left.push_back(std::move(facets[f]));
  return left;
}

/// Keeps the facets with a thin cell. If at least half of the facets of a patch have one, all facets of the patch stay.
std::vector<WallFacet> with_layers(const HighOrderMesh& mesh, std::vector<WallFacet> low) {
  Patches patches = smooth_patches(mesh, low);
  std::vector<std::int64_t> surplus(low.size(), 0);  // of thin facets over the others, by patch
  for (std::size_t f = 0; f < low.size(); ++f) surplus[patches.of(f)] += low[f].is_thin ? 1 : -1;
  return kept(std::move(low), patches,
              [&](std::size_t patch, const WallFacet& facet) { return facet.is_thin || surplus[patch] >= 0; });
}

/// Keeps the facets of each patch that has a curved facet.
std::vector<WallFacet> with_curved_facet(const HighOrderMesh& mesh, std::vector<WallFacet> facets) {
  Patches patches = smooth_patches(mesh, facets);
  std::vector<char> curved(facets.size(), 0);
  for (std::size_t f = 0; f < facets.size(); ++f)
    if (is_curved(mesh, facets[f], shortest_edge(mesh, facets[f].shape, facets[f].nodes))) curved[patches.of(f)] = 1;
  return kept(std::move(facets), patches, [&](std::size_t patch, const WallFacet&) { return curved[patch] != 0; });
}

/// By vertex: the vertices that an edge connects it to, sorted, each once. Only vertices of cells count.
class Neighbours {
 public:
  Neighbours(const HighOrderMesh& mesh, const Cells& cells) : first_(mesh.node_count() + 1, 0) {
    const auto visit = [&](const auto& see) {
      for (std::size_t cell = 0; cell < cells.count(); ++cell) {
        const std::span<const std::int32_t> nodes = cells.nodes(cell);
        for (const auto& edge : reference::info(cells.shape(cell)).edges) {
          see(nodes[at(edge[0])], nodes[at(edge[1])]);
          see(nodes[at(edge[1])], nodes[at(edge[0])]);
        }
      }
    };
    visit([&](std::int32_t a, std::int32_t) { ++first_[at(a) + 1]; });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    to_.resize(first_.back());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    visit([&](std::int32_t a, std::int32_t b) { to_[next[at(a)]++] = b; });
  }
  std::span<const std::int32_t> of(std::int32_t vertex) const {
    return {to_.data() + first_[at(vertex)], to_.data() + first_[at(vertex) + 1]};
  }

 private:
  std::vector<std::size_t> first_;
  std::vector<std::int32_t> to_;
};

/// The next vertex of a column, and how straight the column goes on to it.
struct Rise {
  std::int32_t to = -1;
  double cosine = -1;
};

/// The directions in which columns leave the wall: the mean of the normals of the facets around, into the mesh.
std::vector<Vector> directions(const HighOrderMesh& mesh, const Columns& columns, const Cells& cells) {
  std::vector<Vector> inward(columns.vertices.size(), Vector::Zero());
  for (const WallFacet& facet : columns.facets) {
    // A vertex of a facet with four vertices may lie farther from their plane than the layer is high.
    Vector normal = normal_of(mesh, facet);
    const Vector up = mean_vertex(mesh, cells.shape(at(facet.cell)), cells.nodes(at(facet.cell))) -
                      mean_vertex(mesh, facet.shape, facet.nodes);
    if (normal.dot(up) < 0) normal = -normal;
    for (int v = 0; v < reference::info(facet.shape).vertices; ++v)
      inward[at(columns.column_of[at(facet.nodes[at(v)])])] += normal;
  }
  for (Vector& direction : inward) direction.normalize();
  return inward;
}

void begin_columns(const HighOrderMesh& mesh, Columns& columns) {
  columns.column_of.assign(mesh.node_count(), -1);
  columns.level.assign(mesh.node_count(), 0);
  for (std::size_t f = 0; f < columns.facets.size(); ++f) {
    const WallFacet& facet = columns.facets[f];
    const double size = shortest_edge(mesh, facet.shape, facet.nodes);
    for (int v = 0; v < reference::info(facet.shape).vertices; ++v) {
      std::int32_t& column = columns.column_of[at(facet.nodes[at(v)])];
      if (column < 0) {
        column = static_cast<std::int32_t>(columns.vertices.size());
        columns.vertices.push_back({facet.nodes[at(v)]});
        columns.facets_of.emplace_back();
        columns.size.push_back(size);
        columns.reach.push_back(kThin);
      }
      columns.facets_of[at(column)].push_back(static_cast<std::int32_t>(f));
      columns.size[at(column)] = std::min(columns.size[at(column)], size);
      if (!facet.is_thin) columns.reach[at(column)] = kLow;
    }
  }
  for (std::size_t column = 0; column < columns.size.size(); ++column) columns.reach[column] *= columns.size[column];
}

double length(const HighOrderMesh& mesh, std::int32_t from, std::int32_t to) {
  return (point(mesh, to) - point(mesh, from)).norm();
}

double last_height(const HighOrderMesh& mesh, const std::vector<std::int32_t>& column) {
  return length(mesh, column[column.size() - 2], column.back());
}

/// The vertex to which a column goes on straightest, of those that `may_take` allows. `reach`: as Columns::reach.
template <class MayTake>
Rise next_of(const HighOrderMesh& mesh, const Neighbours& neighbours, const std::vector<std::int32_t>& column,
             const Vector& direction, double reach, const MayTake& may_take) {
  Rise next;
  const bool is_first = column.size() == 1;
  for (const std::int32_t to : neighbours.of(column.back())) {
    const Vector edge = point(mesh, to) - point(mesh, column.back());
    if ((is_first && edge.norm() >= reach) || !may_take(to)) continue;
    const double cosine = edge.dot(direction) / edge.norm();
    if (cosine > (is_first ? kOffTheWall : kOn) && cosine > next.cosine) next = {to, cosine};
  }
  return next;
}

/// Whether the cells above the feet of columns are layers of another wall, by column: the second cell is lower than the
/// first one, and the edges that point on lead to the foot of another column, whose first cell is lower than the first.
std::vector<char> that_go_down(const HighOrderMesh& mesh, const Neighbours& neighbours, const Columns& columns,
                               std::vector<Vector> directions) {
  std::vector<char> down(columns.vertices.size(), 0);
  std::vector<std::int32_t> seen(mesh.node_count(), -1);  // by which column last
  for (std::size_t column = 0; column < down.size(); ++column) {
    const auto self = static_cast<std::int32_t>(column);
    std::vector<std::int32_t> way{columns.vertices[column].front()};
    seen[at(way[0])] = self;
    for (double first = 0;;) {
      const Rise next = next_of(mesh, neighbours, way, directions[column], columns.reach[column],
                                [&](std::int32_t to) { return seen[at(to)] != self; });
      if (next.to < 0) break;
      seen[at(next.to)] = self;
      directions[column] = (point(mesh, next.to) - point(mesh, way.back())).normalized();
      way.push_back(next.to);
      const double height = last_height(mesh, way);
      if (way.size() == 2) first = height;
      if (way.size() == 3 && height >= kGoesDown * first) break;
      if (columns.column_of[at(next.to)] < 0) continue;
      down[column] = way.size() > 2 && height < kShrinks * first ? 1 : 0;
      break;
    }
  }
  return down;
}

/// Raises all columns that still rise by one level. Returns whether one has risen. If two columns want the same vertex,
/// the straighter one gets it, and the other ends.
bool raise(const HighOrderMesh& mesh, const Neighbours& neighbours, std::vector<Vector>& directions,
           std::vector<std::int32_t>& rising, Walls which, Columns& columns) {
  std::vector<Rise> rises(rising.size());
  for (std::size_t i = 0; i < rising.size(); ++i) {
    const std::size_t column = at(rising[i]);
    const std::vector<std::int32_t>& vertices = columns.vertices[column];
    rises[i] = next_of(mesh, neighbours, vertices, directions[column], columns.reach[column], [&](std::int32_t to) {
      return columns.column_of[at(to)] < 0 &&
             (vertices.size() == 1 || which == Walls::Curved ||
              length(mesh, vertices.back(), to) >= kShrinks * last_height(mesh, vertices));
    });
  }
  std::vector<std::size_t> order(rising.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return rises[a].cosine > rises[b].cosine; });
  std::vector<std::int32_t> still;
  for (const std::size_t i : order) {
    const std::size_t column = at(rising[i]);
    const std::int32_t to = rises[i].to;
    if (to < 0 || columns.column_of[at(to)] >= 0) continue;
    directions[column] = (point(mesh, to) - point(mesh, columns.vertices[column].back())).normalized();
    columns.column_of[at(to)] = rising[i];
    columns.level[at(to)] = static_cast<std::int32_t>(columns.vertices[column].size());
    columns.vertices[column].push_back(to);
    still.push_back(rising[i]);
  }
  std::ranges::sort(still);
  rising.swap(still);
  return !rising.empty();
}

/// Drops the facets above which the cells are layers of another wall, and all columns. Returns whether there were some.
bool leave_walls_of_others(const HighOrderMesh& mesh, const Neighbours& neighbours,
                           const std::vector<Vector>& directions, Columns& columns) {
  const std::vector<char> down = that_go_down(mesh, neighbours, columns, directions);
  if (std::ranges::count(down, 1) == 0) return false;
  std::vector<WallFacet> kept;
  for (WallFacet& facet : columns.facets) {
    const auto vertices = std::span(facet.nodes).first(at(reference::info(facet.shape).vertices));
    if (std::ranges::none_of(vertices,
                             [&](std::int32_t vertex) { return down[at(columns.column_of[at(vertex)])] != 0; }))
      kept.push_back(std::move(facet));
  }
  columns = {};
  columns.facets = std::move(kept);
  return true;
}

}  // namespace

Columns find_columns(const HighOrderMesh& mesh, const Facets& facets, Walls which) {
  const Cells cells(mesh, mesh.dimension);
  Columns columns;
  columns.facets = with_layers(mesh, low_facets(mesh, facets, cells));
  if (which == Walls::Curved) columns.facets = with_curved_facet(mesh, std::move(columns.facets));
  if (columns.facets.empty()) return columns;
  begin_columns(mesh, columns);
  std::vector<Vector> direction = directions(mesh, columns, cells);
  const Neighbours neighbours(mesh, cells);
  if (leave_walls_of_others(mesh, neighbours, direction, columns)) {
    if (columns.facets.empty()) return {};
    begin_columns(mesh, columns);
    direction = directions(mesh, columns, cells);
  }
  std::vector<std::int32_t> rising(columns.vertices.size());
  std::iota(rising.begin(), rising.end(), 0);
  while (raise(mesh, neighbours, direction, rising, which, columns)) continue;
  return columns;
}

}  // namespace varimesh::detail
