#include "core/layers/split/wall_columns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/layers/walls.h"
#include "core/mesh/connectivity.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// A wall has a sharp edge where normals of its elements differ by more: the cosine of 40°.
constexpr double kSharp = 0.766;

/// The way from one side of a cell to the opposite side.
struct Rise {
  std::array<int, 4> top{};  ///< The local vertex above each vertex of the facet.
  int opposite = -1;         ///< The facet on the other side.
};

std::optional<Rise> rise_of(Shape shape, int facet) {
  const reference::ShapeInfo& info = reference::info(shape);
  const auto& bottom = info.facets[at(facet)].vertices;
  const int count = reference::info(info.facets[at(facet)].shape).vertices;
  const auto is_bottom = [&](int v) {
    return std::find(bottom.begin(), bottom.begin() + count, v) != bottom.begin() + count;
  };
  Rise rise;
  std::set<int> tops;
  for (int v = 0; v < count; ++v)
    for (const auto& edge : info.edges)
      for (const int end : {0, 1})
        if (edge[at(end)] == bottom[at(v)] && !is_bottom(edge[at(1 - end)])) {
          rise.top[at(v)] = edge[at(1 - end)];
          tops.insert(edge[at(1 - end)]);
        }
  if (static_cast<int>(tops.size()) != count || 2 * count != info.vertices) return std::nullopt;
  for (std::size_t f = 0; f < info.facets.size(); ++f) {
    const auto& vertices = info.facets[f].vertices;
    if (std::ranges::all_of(vertices, [&](int v) { return v < 0 || tops.contains(v); }))
      rise.opposite = static_cast<int>(f);
  }
  return rise.opposite < 0 ? std::nullopt : std::optional(rise);
}

class ColumnFinder {
 public:
  ColumnFinder(const CheckedMesh& checked, int rows)
      : mesh_(checked.mesh), facets_(checked.facets), cells_(mesh_, mesh_.dimension), rows_(rows) {}

  Expected<WallColumns> find(std::span<const std::string> names) {
    const auto walls = find_walls(mesh_, facets_, names);
    if (!walls) return tl::unexpected(walls.error());
    const Cells elements(mesh_, mesh_.dimension - 1);
    for (const auto& [facet, element] : *walls) {
      const ElementBlock& block = *elements.range_of(at(element)).block;
      if (const auto done = add_stack(facet, elements.nodes(at(element)), block.shape); !done)
        return tl::unexpected(done.error());
      ++found_.elements;
    }
    std::ranges::sort(found_.in_rows);
    found_.in_rows.erase(std::unique(found_.in_rows.begin(), found_.in_rows.end()), found_.in_rows.end());
    finish_normals();
    return std::move(found_);
  }

 private:
  Error no_opposite_side(std::size_t cell, int row) const {
    const Shape shape = cells_.shape(cell);
    const std::string what =
        "element " + std::to_string(cells_.number(cell)) + ", a " + std::string(reference::info(shape).name);
    if (row > 0)
      return {Error::Kind::BadInput,
              "Row " + std::to_string(row + 1) + " above the wall has " + what +
                  ", which has no side opposite the row below. The number of rows can be at most " +
                  std::to_string(row) + "."};
    return {Error::Kind::BadInput, "At the wall lies " + what +
                                       ". Layers are made from quadrilaterals, hexahedra, and prisms that stand on a "
                                       "triangle; mesh the wall with a thick layer of such cells, or let one grow."};
  }

  /// Goes from an element of the wall through the rows above it.
  Expected<void> add_stack(std::int32_t facet, std::span<const std::int32_t> wall_nodes, Shape wall_shape) {
    auto cell =
        std::size_t(std::upper_bound(facets_.first.begin(), facets_.first.end(), facet) - facets_.first.begin() - 1);
    int local = facet - facets_.first[cell];
    const int corners = reference::info(wall_shape).vertices;
    std::vector<std::vector<std::int32_t>> paths(at(corners));
    for (int row = 0; row < rows_; ++row) {
      const Shape shape = cells_.shape(cell);
      const auto rise = rise_of(shape, local);
      if (!rise) return tl::unexpected(no_opposite_side(cell, row));
      const auto nodes = cells_.nodes(cell);
      const auto& bottom = reference::info(shape).facets[at(local)].vertices;
      for (int v = 0; v < corners; ++v) {
        const std::int32_t from = nodes[at(bottom[at(v)])], to = nodes[at(rise->top[at(v)])];
        if (row == 0) paths[at(v)] = {from};
        for (auto& path : paths)
          if (!path.empty() && static_cast<int>(path.size()) == row + 1 && path.back() == from) {
            path.push_back(to);
            break;
          }
      }
      found_.in_rows.push_back(static_cast<std::int32_t>(cell));
      if (row + 1 == rows_) break;
      const std::size_t top = at(facets_.first[cell] + rise->opposite);
      if (facets_.neighbour[top] < 0)
        return bad_input("There " + std::string(row == 0 ? "is" : "are") + " only " + std::to_string(row + 1) +
                         (row == 0 ? " row" : " rows") + " of cells above the wall, at element " +
                         std::to_string(cells_.number(cell)) + ". The number of rows can be at most " +
                         std::to_string(row + 1) + ".");
      cell = at(facets_.neighbour[top]);
      local = facets_.opposite[top] - facets_.first[cell];
    }
    add_columns(paths, wall_nodes, wall_shape);
    return {};
  }

  void add_columns(const std::vector<std::vector<std::int32_t>>& paths, std::span<const std::int32_t> wall_nodes,
                   Shape shape) {
    Vector inward = Vector::Zero();
    for (const auto& path : paths) inward += point(mesh_, path[1]) - point(mesh_, path[0]);
    const auto [table, is_new] = tables_.try_emplace(shape, shape, mesh_.order, mesh_.dimension);
    const std::vector<Vector> normals = table->second.normals(mesh_, wall_nodes, inward);
    const double size = shortest_edge(mesh_, shape, wall_nodes);
    for (const auto& path : paths) {
      const auto [known, is_first] = known_.try_emplace({path[0], path[1]}, found_.columns.size());
      if (is_first) {
        found_.columns.push_back({path, Vector::Zero(), {}, size});
      }
      WallColumn& column = found_.columns[known->second];
      column.size = std::min(column.size, size);
      const auto corner = std::ranges::find(wall_nodes, path[0]) - wall_nodes.begin();
      column.normals.push_back(normals[at(corner)]);
    }
  }

  void finish_normals() {
    for (WallColumn& column : found_.columns) {
      Vector sum = Vector::Zero();
      for (const Vector& normal : column.normals) sum += normal;
      sum.normalize();
      const bool smooth = std::ranges::all_of(column.normals, [&](const Vector& n) {
        return n.dot(column.normals.front()) > kSharp && n.dot(sum) > kSharp;
      });
      if (smooth) column.normal = sum;
    }
  }

  const HighOrderMesh& mesh_;
  const Facets& facets_;
  Cells cells_;
  int rows_;
  WallColumns found_;
  std::map<std::pair<std::int32_t, std::int32_t>, std::size_t> known_;
  std::map<Shape, FacetTable> tables_;
};

}  // namespace

Vector WallColumn::normal_seen_least(const Vector& direction) const {
  if (!normal.isZero(0)) return normal;
  return *std::ranges::min_element(normals, {}, [&](const Vector& n) { return n.dot(direction); });
}

Expected<WallColumns> find_wall_columns(const CheckedMesh& mesh, std::span<const std::string> walls, int rows) {
  return ColumnFinder(mesh, rows).find(walls);
}

}  // namespace varimesh::detail
