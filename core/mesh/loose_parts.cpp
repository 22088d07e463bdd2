#include "core/mesh/loose_parts.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/mesh/bounding_box.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh {

namespace {

using Vector = Eigen::RowVector3d;

Eigen::Map<const Vector> place(const HighOrderMesh& mesh, std::int32_t node) {
  return Eigen::Map<const Vector>(mesh.coordinates.data() + 3 * static_cast<std::size_t>(node));
}

// A facet with one cell.
struct Side {
  Shape shape;
  std::vector<std::int32_t> nodes;
};

std::vector<Side> boundary_sides(const HighOrderMesh& mesh, const Facets& facets) {
  std::vector<Side> sides;
  const Cells cells(mesh, mesh.dimension);
  for (const Cells::Range& range : cells.ranges()) {
    const auto shapes = reference::info(range.block->shape).facets;
    for (std::size_t e = 0; e < range.block->size(); ++e)
      for (std::size_t f = 0; f < shapes.size(); ++f) {
        if (facets.neighbour[static_cast<std::size_t>(facets.first[range.first + e]) + f] >= 0) continue;
        Side& side = sides.emplace_back(Side{shapes[f].shape, {}});
        for (const int local : reference::facet_nodes(range.block->shape, mesh.order, static_cast<int>(f)))
          side.nodes.push_back(range.block->nodes[e * range.stride + static_cast<std::size_t>(local)]);
      }
  }
  return sides;
}

std::vector<std::int32_t> distinct_nodes(const std::vector<Side>& sides, bool only_vertices) {
  std::vector<std::int32_t> nodes;
  for (const Side& side : sides) {
    const auto count =
        only_vertices ? static_cast<std::size_t>(reference::info(side.shape).vertices) : side.nodes.size();
    nodes.insert(nodes.end(), side.nodes.begin(), side.nodes.begin() + static_cast<std::ptrdiff_t>(count));
  }
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

// === Hanging nodes =======================================================================================

struct Box {
  Vector low, high;
};

Box box_of(const HighOrderMesh& mesh, const Side& side) {
  Box box{place(mesh, side.nodes[0]), place(mesh, side.nodes[0])};
  for (const std::int32_t node : side.nodes) {
    box.low = box.low.cwiseMin(place(mesh, node));
    box.high = box.high.cwiseMax(place(mesh, node));
  }
  return box;
}

// The part of the facet's size that a node may be beside it. On a curved side a finer mesh puts its nodes on the
// geometry.
constexpr double kOn = 1e-3;

/// Whether a point is clearly beside a line or triangle, as far as its vertices tell. A vertex of the triangle beside
/// is, although it may lie in the box.
bool is_far_beside(const HighOrderMesh& mesh, const Side& side, const Vector& point) {
  if (side.shape == Shape::Quadrilateral) return false;
  constexpr double kBeside = -0.3;
  const Vector x = point - place(mesh, side.nodes[0]), u = place(mesh, side.nodes[1]) - place(mesh, side.nodes[0]);
  if (side.shape == Shape::Line) {
    const double t = u.dot(x) / u.squaredNorm();
    return t < kBeside || 1 - t < kBeside;
  }
  const Vector v = place(mesh, side.nodes[2]) - place(mesh, side.nodes[0]);
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), determinant = uu * vv - uv * uv;
  const double a = (vv * u.dot(x) - uv * v.dot(x)) / determinant, b = (uu * v.dot(x) - uv * u.dot(x)) / determinant;
  return std::min({a, b, 1 - a - b}) < kBeside;
}

/// Whether a point lies on a facet. Gauss–Newton's method from the facet's nearest node looks for the nearest point.
bool lies_on(const HighOrderMesh& mesh, const Side& side, const Vector& point, double size) {
  const int order = mesh.order;
  Eigen::MatrixX3d x(static_cast<Eigen::Index>(side.nodes.size()), 3);
  for (std::size_t i = 0; i < side.nodes.size(); ++i) x.row(static_cast<Eigen::Index>(i)) = place(mesh, side.nodes[i]);
  const reference::Points& all = reference::nodes(side.shape, order, reference::NodeSet::Equispaced, mesh.dimension);
  Eigen::Index nearest = 0;
  (x.rowwise() - point).rowwise().squaredNorm().minCoeff(&nearest);
  reference::Points at = all.row(nearest);
  constexpr int kSteps = 8;
  for (int step = 0; step < kSteps; ++step) {
    const auto set = reference::NodeSet::Equispaced;
    const Vector miss = point - reference::basis_values(side.shape, order, set, mesh.dimension, at) * x;
    if (miss.norm() < kOn * size) break;
    const auto gradients = reference::basis_gradients(side.shape, order, set, mesh.dimension, at);
    const Vector u = gradients[0] * x, v = gradients.size() > 1 ? Vector(gradients[1] * x) : Vector(Vector::Zero());
    const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), um = u.dot(miss), vm = v.dot(miss);
    if (gradients.size() == 1) {
      if (!(uu > 0)) return false;
      at(0, 0) += um / uu;
    } else {
      const double determinant = uu * vv - uv * uv;
      if (!(determinant > 0)) return false;
      at(0, 0) += (vv * um - uv * vm) / determinant;
      at(0, 1) += (uu * vm - uv * um) / determinant;
    }
    at = at.cwiseMax(-1.2).cwiseMin(1.2);
  }
  constexpr double kEdge = 1 + 1e-4;
  const bool inside = at.cwiseAbs().maxCoeff() <= kEdge && (side.shape != Shape::Triangle || at.sum() <= kEdge - 1);
  const Vector miss =
      point - reference::basis_values(side.shape, order, reference::NodeSet::Equispaced, mesh.dimension, at) * x;
  return inside && miss.norm() < kOn * size;
}

/// Vertices of the boundary that lie on a boundary facet but are not among its nodes. Each comes with a node of it.
std::vector<std::pair<std::int32_t, std::int32_t>> hanging_nodes(const HighOrderMesh& mesh,
                                                                 const std::vector<Side>& sides, const Vector& extent,
                                                                 double tolerance) {
  Eigen::Index axis = 0;
  extent.maxCoeff(&axis);
  std::vector<std::int32_t> vertices = distinct_nodes(sides, true);
  std::ranges::sort(vertices, {}, [&](std::int32_t node) { return place(mesh, node)[axis]; });
  std::vector<std::pair<std::int32_t, std::int32_t>> found;
  for (const Side& side : sides) {
    const Box box = box_of(mesh, side);
    const double size = (box.high - box.low).norm(), slack = kOn * size;
    const auto from = std::ranges::lower_bound(vertices, box.low[axis] - slack, {},
                                               [&](std::int32_t node) { return place(mesh, node)[axis]; });
    for (auto at = from; at != vertices.end() && place(mesh, *at)[axis] <= box.high[axis] + slack; ++at) {
      const Vector x = place(mesh, *at);
      if (((box.low - x).array() > slack).any() || ((x - box.high).array() > slack).any()) continue;
      const bool at_node = std::ranges::any_of(
          side.nodes, [&](std::int32_t node) { return node == *at || (place(mesh, node) - x).norm() <= tolerance; });
      if (!at_node && !is_far_beside(mesh, side, x) && lies_on(mesh, side, x, size))
        found.emplace_back(*at, side.nodes[0]);
    }
  }
  std::ranges::sort(found);
  found.erase(std::unique(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first == b.first; }),
              found.end());
  return found;
}

// === Sentences ===========================================================================================

std::string number_of(const HighOrderMesh& mesh, std::int32_t node) {
  return std::to_string(mesh.node_numbers[static_cast<std::size_t>(node)]);
}

/// By node: whether a cell has it.
std::vector<bool> nodes_of_cells(const HighOrderMesh& mesh) {
  std::vector<bool> in_cell(mesh.node_count(), false);
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension)
      for (const std::int32_t node : block.nodes) in_cell[static_cast<std::size_t>(node)] = true;
  return in_cell;
}

void say_idle(const HighOrderMesh& mesh, const Facets& facets, std::vector<std::string>& sentences) {
  const Cells borders(mesh, mesh.dimension - 1);
  std::vector<bool> is_facet(borders.count(), false);
  for (const auto& [_, element] : facets.elements) is_facet[static_cast<std::size_t>(element)] = true;
  // Of several elements on one facet, the list has the first.
  const std::vector<bool> in_cell = nodes_of_cells(mesh);
  std::size_t idle = 0, first = 0;
  for (std::size_t e = 0; e < borders.count(); ++e) {
    const auto nodes = borders.nodes(e);
    if (is_facet[e] || std::ranges::all_of(nodes, [&](std::int32_t n) { return in_cell[static_cast<std::size_t>(n)]; }))
      continue;
    if (idle++ == 0) first = e;
  }
  const char* kind = mesh.dimension == 3 ? "face" : "edge";
  if (idle > 0)
    sentences.push_back(std::to_string(idle) + (idle == 1 ? " boundary element lies" : " boundary elements lie") +
                        " on no cell, for example element " + std::to_string(borders.number(first)) + ": no " + kind +
                        " of a cell has its nodes.");
}

}  // namespace

std::vector<std::pair<std::int32_t, std::int32_t>> coincident_nodes(const HighOrderMesh& mesh,
                                                                    const std::vector<std::int32_t>& nodes,
                                                                    double tolerance) {
  const auto x = [&](std::int32_t node) { return mesh.coordinates.data() + 3 * static_cast<std::size_t>(node); };
  // Nodes that are near each other are near each other in every direction. In this one, hardly any others are: nodes of
  // a plane or of a grid along the axes are not.
  constexpr double kAcross[] = {0.5698402909980532, 0.7548776662466927, 0.3247179572447460};  // a unit vector, nearly
  std::vector<std::pair<double, std::int32_t>> sorted;
  for (const std::int32_t node : nodes)
    sorted.emplace_back(kAcross[0] * x(node)[0] + kAcross[1] * x(node)[1] + kAcross[2] * x(node)[2], node);
  std::ranges::sort(sorted);
  // A forest by place in `sorted`; the root of a tree has its lowest node.
  std::vector<std::size_t> parent(sorted.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (std::size_t i = 0; i < sorted.size(); ++i)
    for (std::size_t k = i + 1; k < sorted.size() && sorted[k].first - sorted[i].first <= tolerance; ++k) {
      const double *a = x(sorted[i].second), *b = x(sorted[k].second);
      if (std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) > tolerance) continue;
      const std::size_t one = root(i), other = root(k);
      if (sorted[one].second < sorted[other].second)
        parent[other] = one;
      else
        parent[one] = other;
    }
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  for (std::size_t i = 0; i < sorted.size(); ++i)
    if (const std::int32_t lowest = sorted[root(i)].second; lowest < sorted[i].second)
      pairs.emplace_back(sorted[i].second, lowest);
  std::ranges::sort(pairs);
  return pairs;
}

std::string lone_nodes_text(std::int64_t count, std::int64_t first) {
  if (count == 0) return "";
  return std::to_string(count) + (count == 1 ? " node belongs" : " nodes belong") + " to no cell, for example node " +
         std::to_string(first) + ".";
}

std::vector<std::string> loose_parts(const HighOrderMesh& mesh, const Facets& facets, const Team& team) {
  std::vector<std::string> sentences = loose_boundary(mesh, facets, team);
  const std::vector<bool> in_cell = nodes_of_cells(mesh);
  const auto first = std::ranges::find(in_cell, false) - in_cell.begin();
  if (const auto count = std::ranges::count(in_cell, false); count > 0)
    sentences.push_back(lone_nodes_text(count, mesh.node_numbers[static_cast<std::size_t>(first)]));
  return sentences;
}

std::vector<std::string> loose_boundary(const HighOrderMesh& mesh, const Facets& facets, const Team& team) {
  std::vector<std::string> sentences;
  const auto [low, high] = bounding_box(mesh, team);
  const Vector extent(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  constexpr double kSame = 1e-9;
  const double tolerance = kSame * extent.norm();
  const std::vector<Side> sides = boundary_sides(mesh, facets);
  if (const auto pairs = coincident_nodes(mesh, distinct_nodes(sides, false), tolerance); !pairs.empty())
    sentences.push_back(std::to_string(pairs.size()) +
                        (pairs.size() == 1 ? " node of the boundary lies" : " nodes of the boundary lie") +
                        " where another node lies, for example node " + number_of(mesh, pairs[0].first) + " on node " +
                        number_of(mesh, pairs[0].second) +
                        ": the cells there do not hang together. If they should, merge_nodes joins such nodes.");
  if (const auto found = hanging_nodes(mesh, sides, extent, tolerance); !found.empty())
    sentences.push_back(std::to_string(found.size()) +
                        (found.size() == 1 ? " vertex of the boundary lies" : " vertices of the boundary lie") +
                        " on a side of a cell that does not have it (a hanging node), for example node " +
                        number_of(mesh, found[0].first) + " on the side of node " + number_of(mesh, found[0].second) +
                        ": the cells there do not conform, and both sides keep their nodes as a boundary does.");
  say_idle(mesh, facets, sentences);
  return sentences;
}

}  // namespace varimesh
