#include "core/layers/placement.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <span>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/layers/spacing.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// The linear functions of the vertices at the equispaced nodes: nodes × vertices.
Eigen::MatrixXd vertex_weights(Shape shape, int order, int dimension) {
  const reference::Points& nodes = reference::nodes(shape, order, reference::NodeSet::Equispaced, dimension);
  return reference::basis_values(shape, 1, reference::NodeSet::Equispaced, dimension, nodes);
}

/// A node of a layer cell: its place on the facet, and its level as a multiple of 1/P above the lower level.
struct NodeInLayer {
  int on_facet;                   ///< Local node of the facet.
  int step;                       ///< 0 … P.
  std::array<double, 4> weights;  ///< Of the vertices of the facet.
  int only;                       ///< The vertex of the facet whose column it is on; −1: it is between columns.
};

/// If a fixed node at the top of a cell is this far from the parallel surface, relative to the height of the cell, all
/// fixed nodes there are on another surface. If single ones of them counted, the shift of the others would not be
/// smooth: above a bump, at order 5, that gave waves four times the error.
constexpr double kFades = 1e-3;

/// Of the places and normals that cells want for a node.
struct Sum {
  Vector place = Vector::Zero(), normal = Vector::Zero();
  int count = 0;
};

class Placer {
 public:
  Placer(const HighOrderMesh& mesh, const Columns& columns, LayerSpacing spacing, const std::vector<bool>& fixed,
         const FlatSides& sides)
      : mesh_(mesh),
        columns_(columns),
        spacing_(spacing),
        fixed_(fixed),
        sides_(sides),
        cells_(mesh, mesh.dimension),
        on_column_(columns.vertices.size()) {}

  Placement place() {
    for (std::size_t cell = 0; cell < cells_.count(); ++cell)
      if (auto found = layer_cell(static_cast<std::int32_t>(cell))) placement_.cells.push_back(*found);
    for (const LayerCell& cell : placement_.cells) note_columns(cell);
    std::erase_if(placement_.cells, [&](const LayerCell& cell) { return !is_whole(cell); });
    space_columns();
    for (const LayerCell& cell : placement_.cells) add(cell);
    for (const LayerCell& cell : placement_.cells) note_fixed_tops(cell);
    for (const LayerCell& cell : placement_.cells) fade(cell);
    for (const auto& [node, shift] : shifts_) {
      Sum& sum = sums_.at(node);
      sum.place += sum.count / static_cast<double>(shift.count) * shift.place;
    }
    for (const auto& [node, sum] : sums_) {
      const Vector normal = sum.normal.normalized(), from = point(mesh_, node);
      Vector place = sum.place / sum.count;
      if (sides_.has(node)) place = from + sides_.along(node, place - from);
      placement_.nodes.push_back(node);
      for (int c = 0; c < 3; ++c) {
        placement_.coordinates.push_back(place[c]);
        placement_.normals.push_back(normal[c]);
      }
    }
    return std::move(placement_);
  }

 private:
  bool stays(std::int32_t node) const { return fixed_[at(node)] && !sides_.has(node); }

  const Eigen::MatrixXd& weights_of(Shape shape) {
    auto& weights = weights_[static_cast<std::size_t>(shape)];
    if (!weights) weights = vertex_weights(shape, mesh_.order, mesh_.dimension);
    return *weights;
  }
  const FacetTable& table_of(Shape shape) {
    auto& table = tables_[static_cast<std::size_t>(shape)];
    if (!table) table.emplace(shape, mesh_.order, mesh_.dimension);
    return *table;
  }

  /// A cell whose vertices are on two levels of columns above one facet. Where cells of another shape begin, as
  /// triangles do around layers of quadrilaterals, the layers end, although columns may go on by chance.
  std::optional<LayerCell> layer_cell(std::int32_t cell) {
    if (cells_.shape(at(cell)) == Shape::Pyramid) return std::nullopt;
    const std::span<const std::int32_t> nodes = cells_.nodes(at(cell));
    const int vertices = reference::info(cells_.shape(at(cell))).vertices;
    LayerCell found;
    int lowest = std::numeric_limits<int>::max();
    for (int v = 0; v < vertices; ++v) {
      if (columns_.column_of[at(nodes[at(v)])] < 0) return std::nullopt;
      found.level = std::max(found.level, columns_.level[at(nodes[at(v)])]);
      lowest = std::min(lowest, columns_.level[at(nodes[at(v)])]);
    }
    if (lowest != found.level - 1) return std::nullopt;
    for (const std::int32_t facet : columns_.facets_of[at(columns_.column_of[at(nodes[0])])]) {
      bool all = cells_.shape(at(columns_.facets[at(facet)].cell)) == cells_.shape(at(cell));
      for (int v = 0; v < vertices && all; ++v) all = corner(facet, nodes[at(v)]) >= 0;
      if (all && (found.facet < 0 || facet < found.facet)) found.facet = facet;
    }
    if (found.facet < 0 || !measure(found)) return std::nullopt;
    found.cell = cell;
    return found;
  }

  /// Which vertex of the facet the column of a vertex begins at; −1: none.
  int corner(std::int32_t facet, std::int32_t vertex) const {
    const WallFacet& wall = columns_.facets[at(facet)];
    const std::int32_t foot = columns_.vertices[at(columns_.column_of[at(vertex)])].front();
    for (int v = 0; v < reference::info(wall.shape).vertices; ++v)
      if (wall.nodes[at(v)] == foot) return v;
    return -1;
  }

  std::size_t column(const LayerCell& cell, int corner) const {
    return at(columns_.column_of[at(columns_.facets[at(cell.facet)].nodes[at(corner)])]);
  }

  int corners(const LayerCell& cell) const { return reference::info(columns_.facets[at(cell.facet)].shape).vertices; }

  /// Sets the height and the width. False if a column of the facet does not reach the level.
  bool measure(LayerCell& cell) const {
    const WallFacet& facet = columns_.facets[at(cell.facet)];
    const auto vertex = [&](int corner, std::int32_t level) {
      return point(mesh_, columns_.vertices[column(cell, corner)][at(level)]);
    };
    for (int v = 0; v < corners(cell); ++v)
      if (columns_.vertices[column(cell, v)].size() <= at(cell.level)) return false;
    cell.height = cell.width = std::numeric_limits<double>::infinity();
    for (int v = 0; v < corners(cell); ++v)
      cell.height = std::min(cell.height, (vertex(v, cell.level) - vertex(v, cell.level - 1)).norm());
    for (const auto& edge : reference::info(facet.shape).edges)
      for (const std::int32_t level : {cell.level - 1, cell.level})
        cell.width = std::min(cell.width, (vertex(edge[0], level) - vertex(edge[1], level)).norm());
    return true;
  }

  /// Where a node of the cell is; nothing if it is at no place of the lattice.
  std::optional<NodeInLayer> in_layer(const LayerCell& cell, int local) {
    const Shape shape = cells_.shape(at(cell.cell));
    const Eigen::MatrixXd& weights = weights_of(shape);
    const std::span<const std::int32_t> nodes = cells_.nodes(at(cell.cell));
    NodeInLayer found{-1, 0, {}, -1};
    double level = 0;
    for (int v = 0; v < reference::info(shape).vertices; ++v) {
      const double weight = weights(local, v);
      found.weights[at(corner(cell.facet, nodes[at(v)]))] += weight;
      level += weight * (columns_.level[at(nodes[at(v)])] - (cell.level - 1));
    }
    const int order = mesh_.order;
    found.step = static_cast<int>(std::lround(order * level));
    for (int v = 0; v < 4; ++v)
      if (found.weights[at(v)] > 1 - 1e-9) found.only = v;
    const Shape facet = columns_.facets[at(cell.facet)].shape;
    const double i = found.weights[1] + (facet == Shape::Quadrilateral ? found.weights[2] : 0);
    const double j =
        facet == Shape::Line ? 0 : found.weights[2] + (facet == Shape::Quadrilateral ? found.weights[3] : 0);
    found.on_facet =
        table_of(facet).node_at({static_cast<int>(std::lround(order * i)), static_cast<int>(std::lround(order * j))});
    const bool is_on_lattice = std::abs(order * level - found.step) < 1e-6 &&
                               std::abs(order * i - std::lround(order * i)) < 1e-6 &&
                               std::abs(order * j - std::lround(order * j)) < 1e-6;
    return is_on_lattice && found.on_facet >= 0 ? std::optional(found) : std::nullopt;
  }

  /// Notes the nodes of the cell that are on columns.
  void note_columns(const LayerCell& cell) {
    const std::span<const std::int32_t> nodes = cells_.nodes(at(cell.cell));
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const auto found = in_layer(cell, static_cast<int>(k));
      if (!found || found->only < 0) continue;
      std::vector<std::int32_t>& on = on_column_[column(cell, found->only)];
      const std::size_t place = at((cell.level - 1) * mesh_.order + found->step);
      if (on.size() <= place) on.resize(place + 1, -1);
      on[place] = nodes[k];
    }
  }

  /// Whether all nodes have a place and the columns have all nodes that it takes.
  bool is_whole(const LayerCell& cell) {
    const std::size_t top = at(cell.level * mesh_.order);
    for (int v = 0; v < corners(cell); ++v) {
      const std::vector<std::int32_t>& on = on_column_[column(cell, v)];
      if (on.size() <= top) return false;
      for (std::size_t k = top - at(mesh_.order); k <= top; ++k)
        if (on[k] < 0) return false;
    }
    const auto count = static_cast<int>(cells_.nodes(at(cell.cell)).size());
    for (int k = 0; k < count; ++k)
      if (!in_layer(cell, k)) return false;
    return true;
  }

  /// Where the columns have their nodes with the spacing that is wanted.
  void space_columns() {
    for (std::size_t column = 0; column < on_column_.size(); ++column) {
      const std::vector<std::int32_t>& nodes = on_column_[column];
      std::vector<Vector> points;
      for (const std::int32_t node : nodes) points.push_back(node < 0 ? Vector(Vector::Zero()) : point(mesh_, node));
      const auto known = static_cast<int>(std::ranges::find(nodes, -1) - nodes.begin());
      points_.push_back(spaced_column(points, (known - 1) / mesh_.order, mesh_.order, columns_.size[column], spacing_));
      for (std::size_t place = 0; place < nodes.size(); ++place)
        if (nodes[place] >= 0 && stays(nodes[place])) points_.back()[place] = points[place];
    }
  }

  /// The normals of the facet at its nodes, which are kept.
  const std::vector<Vector>& normals_of(std::int32_t facet) {
    auto& normals = normals_[facet];
    if (!normals.empty()) return normals;
    const WallFacet& wall = columns_.facets[at(facet)];
    Vector inward = Vector::Zero();
    for (int v = 0; v < reference::info(wall.shape).vertices; ++v) {
      const auto& vertices = columns_.vertices[at(columns_.column_of[at(wall.nodes[at(v)])])];
      if (vertices.size() > 1) inward += point(mesh_, vertices[1]) - point(mesh_, vertices[0]);
    }
    return normals = table_of(wall.shape).normals(mesh_, wall.nodes, inward);
  }

  /// Adds where the nodes of the cell lie on parallel surfaces.
  void add(const LayerCell& cell) {
    const std::span<const std::int32_t> nodes = cells_.nodes(at(cell.cell));
    const WallFacet& wall = columns_.facets[at(cell.facet)];
    const std::vector<Vector>& normals = normals_of(cell.facet);
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const NodeInLayer node = *in_layer(cell, static_cast<int>(k));
      if (node.step == 0 && cell.level == 1) continue;  // on the wall
      const std::size_t place = at((cell.level - 1) * mesh_.order + node.step);
      const Vector& normal = normals[at(node.on_facet)];
      double up = 0;
      Vector along = Vector::Zero();
      for (int v = 0; v < corners(cell); ++v) {
        const Vector to = points_[column(cell, v)][place] - point(mesh_, wall.nodes[at(v)]);
        const double height = to.dot(normals[at(v)]);
        up += node.weights[at(v)] * height;
        along += node.weights[at(v)] * (to - height * normals[at(v)]);
      }
      const Vector x =
          node.only >= 0
              ? points_[column(cell, node.only)][place]
              : Vector(point(mesh_, wall.nodes[at(node.on_facet)]) + up * normal + along - normal.dot(along) * normal);
      Sum& sum = sums_[nodes[k]];
      sum.place += x;
      sum.normal += normal;
      ++sum.count;
    }
  }

  using TopNode = std::array<std::int32_t, 3>;  ///< Facet, node of the facet, level.
  static TopNode above(const LayerCell& cell, const NodeInLayer& node) {
    return {cell.facet, static_cast<std::int32_t>(node.on_facet), cell.level};
  }

  /// Notes how far the fixed nodes at the top of the cell are from the parallel surface.
  void note_fixed_tops(const LayerCell& cell) {
    const std::span<const std::int32_t> nodes = cells_.nodes(at(cell.cell));
    std::vector<std::pair<TopNode, Vector>> tops;
    double farthest = 0;
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const NodeInLayer node = *in_layer(cell, static_cast<int>(k));
      if (node.step != mesh_.order || !stays(nodes[k])) continue;
      const Sum& sum = sums_.at(nodes[k]);
      tops.emplace_back(above(cell, node), point(mesh_, nodes[k]) - sum.place / sum.count);
      farthest = std::max(farthest, tops.back().second.norm());
    }
    if (farthest > kFades * cell.height) tops_.insert(tops.begin(), tops.end());
  }

  /// Below fixed nodes that are elsewhere, the parallel surfaces of the cell fade to the surface that these nodes are
  /// on.
  void fade(const LayerCell& cell) {
    const std::span<const std::int32_t> nodes = cells_.nodes(at(cell.cell));
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const NodeInLayer node = *in_layer(cell, static_cast<int>(k));
      const auto top = tops_.find(above(cell, node));
      if (top == tops_.end() || node.step == 0) continue;
      Sum& shift = shifts_[nodes[k]];
      shift.place += static_cast<double>(node.step) / mesh_.order * top->second;
      ++shift.count;
    }
  }

  const HighOrderMesh& mesh_;
  const Columns& columns_;
  const LayerSpacing spacing_;
  const std::vector<bool>& fixed_;
  const FlatSides& sides_;
  const Cells cells_;
  /// By column, by P · level: the node there, or −1.
  std::vector<std::vector<std::int32_t>> on_column_;
  std::vector<std::vector<Vector>> points_;  ///< Where these nodes are wanted.
  std::array<std::optional<Eigen::MatrixXd>, kShapes> weights_;
  std::array<std::optional<FacetTable>, kShapes> tables_;
  std::map<std::int32_t, std::vector<Vector>> normals_;
  std::map<std::int32_t, Sum> sums_;    ///< By node.
  std::map<TopNode, Vector> tops_;      ///< Where fixed nodes are, from where they would be.
  std::map<std::int32_t, Sum> shifts_;  ///< By node: how far it is shifted towards such nodes.
  Placement placement_;
};

}  // namespace

Placement place_in_layers(const HighOrderMesh& mesh, const Columns& columns, LayerSpacing spacing,
                          const std::vector<bool>& fixed, const FlatSides& sides) {
  return Placer(mesh, columns, spacing, fixed, sides).place();
}

}  // namespace varimesh::detail
