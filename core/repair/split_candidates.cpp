// Goes through fixed vertices and through cells with two fixed faces.
#include "core/repair/split_candidates.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <utility>

#include "core/base/index.h"
#include "core/diagnosis/gather.h"
#include "core/diagnosis/link_margin.h"
#include "core/diagnosis/node_positions.h"
#include "core/diagnosis/vertex_corners.h"
#include "core/reference/basis.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

void add_unique(std::vector<SplitPlace>& places, const SplitPlace& place) {
  if (std::ranges::find(places, place) == places.end()) places.push_back(place);
}

/// Adds the edge if it may be split, or else the face if that may be split.
void add_candidate(const SplitRules& rules, const SplitPlace& edge, const SplitPlace& face,
                   std::vector<SplitPlace>& candidates) {
  if (rules.may_split(edge))
    add_unique(candidates, edge);
  else if (rules.may_split(face))
    add_unique(candidates, face);
}

/// Adds the weak groups at a fixed vertex.
void at_vertex(const detail::VertexCorners::Link& link, const SplitRules& rules, const WeakRule& rule,
               std::vector<WeakGroup>& out) {
  if (std::ranges::any_of(link.corners, [](const detail::LinkCorner& corner) { return corner.size() != 3; })) return;
  for (const detail::LinkPiece& piece : detail::link_pieces(link.directions, link.corners, rule.margin)) {
    WeakGroup group;
    group.vertex = link.node;
    group.margin = piece.margin;
    for (const std::int32_t k : piece.corners) group.cells.push_back(link.corners[at(k)].cell);
    std::ranges::sort(group.cells);
    const auto is_marked = [&](std::int32_t cell) {
      return std::ranges::binary_search(rule.marked, std::pair{cell, link.node});
    };
    const auto is_wanted = [&](std::int32_t cell) { return rule.wanted[at(cell)]; };
    if ((group.margin > rule.margin || std::ranges::none_of(group.cells, is_wanted)) &&
        std::ranges::none_of(group.cells, is_marked))
      continue;
    for (const auto& [p, q] : piece.fence) {
      const std::int32_t a = link.ends[at(p)], b = link.ends[at(q)];
      const SplitPlace face = face_place(link.node, a, b);
      if (!rules.is_boundary(face)) add_candidate(rules, edge_place(a, b), face, group.candidates);
    }
    if (!group.candidates.empty()) out.push_back(std::move(group));
  }
}

/// Derivatives at points of an edge: along the edge, and into the two faces that meet there.
struct EdgeTable {
  int a, b, c, d;  // the ends of the edge, and the third vertex of each face
  std::array<Eigen::MatrixXd, 3> derivative;
};

std::vector<EdgeTable> edge_tables(int order) {
  const auto& info = reference::info(Shape::Tetrahedron);
  std::vector<EdgeTable> tables;
  for (int a = 0; a < 4; ++a)
    for (int b = 0; b < a; ++b) {
      int c = 0;
      while (c == a || c == b) ++c;
      const int d = 6 - a - b - c;
      const auto vertex = [&](int v) {
        return Eigen::RowVector3d(info.vertex[at(v)][0], info.vertex[at(v)][1], info.vertex[at(v)][2]);
      };
      const int intervals = 2 * order + 2;
      reference::Points points(intervals + 1, 3);
      for (int i = 0; i <= intervals; ++i)
        points.row(i) = vertex(a) + (vertex(b) - vertex(a)) * (static_cast<double>(i) / intervals);
      const auto gradient =
          reference::basis_gradients(Shape::Tetrahedron, order, reference::NodeSet::Equispaced, 3, points);
      EdgeTable table{a, b, c, d, {}};
      const std::array<Eigen::RowVector3d, 3> along{vertex(b) - vertex(a), vertex(c) - vertex(a),
                                                    vertex(d) - vertex(a)};
      for (std::size_t k = 0; k < 3; ++k)
        table.derivative[k] = along[k][0] * gradient[0] + along[k][1] * gradient[1] + along[k][2] * gradient[2];
      // In the order in which the determinant is positive if the cell is.
      Eigen::Matrix3d sense;
      for (int k = 0; k < 3; ++k) sense.row(k) = along[at(k)];
      if (sense.determinant() < 0) {
        std::swap(table.c, table.d);
        std::swap(table.derivative[1], table.derivative[2]);
      }
      tables.push_back(std::move(table));
    }
  return tables;
}

/// The smallest determinant along the edge of the unit tangent and the unit directions into both faces.
double edge_margin(const EdgeTable& table, const Eigen::MatrixXd& x, double sign) {
  const Eigen::MatrixXd t = table.derivative[0] * x, c = table.derivative[1] * x, d = table.derivative[2] * x;
  double result = 1;
  for (Eigen::Index i = 0; i < t.rows(); ++i) {
    // The direction into a face is the part of the derivative that is perpendicular to the edge.
    const Eigen::RowVector3d along = t.row(i).normalized();
    const Eigen::RowVector3d into_c = (c.row(i) - c.row(i).dot(along) * along).normalized();
    const Eigen::RowVector3d into_d = (d.row(i) - d.row(i).dot(along) * along).normalized();
    result = std::min(result, sign * along.dot(into_c.cross(into_d)));
  }
  return result;
}

/// Adds a group for each edge between two boundary faces of the cell that has little room.
void along_edges(const HighOrderMesh& mesh, const Cells& cells, std::int32_t cell, const std::vector<EdgeTable>& tables,
                 const SplitRules& rules, const WeakRule& rule, double sign, std::vector<WeakGroup>& out) {
  const auto nodes = cells.nodes(at(cell));
  std::array<bool, 4> boundary{};  // the face opposite each vertex
  for (std::size_t v = 0; v < 4; ++v)
    boundary[v] = rules.is_boundary(face_place(nodes[(v + 1) % 4], nodes[(v + 2) % 4], nodes[(v + 3) % 4]));
  if (std::ranges::count(boundary, true) < 2) return;
  const Eigen::MatrixXd x = detail::node_positions(mesh.coordinates, nodes);
  for (const EdgeTable& table : tables) {
    if (!boundary[at(table.c)] || !boundary[at(table.d)]) continue;
    WeakGroup group;
    group.cells = {cell};
    group.margin = edge_margin(table, x, sign);
    if (group.margin > rule.margin) continue;
    const std::int32_t a = nodes[at(table.a)], b = nodes[at(table.b)], c = nodes[at(table.c)], d = nodes[at(table.d)];
    add_candidate(rules, edge_place(c, d), face_place(a, c, d), group.candidates);
    if (group.candidates.empty()) add_candidate(rules, face_place(b, c, d), face_place(b, c, d), group.candidates);
    if (!group.candidates.empty()) out.push_back(std::move(group));
  }
}

}  // namespace

std::vector<WeakGroup> weak_groups(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const SplitRules& rules,
                                   const WeakRule& rule, const Team& team) {
  const Cells cells(mesh, mesh.dimension);
  const double sign = detail::orientation(mesh);
  const detail::VertexCorners corners(mesh, cells, fixed, sign);
  const std::vector<EdgeTable> tables = edge_tables(mesh.order);
  constexpr std::size_t kChunk = 64;
  std::vector<WeakGroup> groups;
  detail::gather(team, corners.vertices(), kChunk, groups,
                 [&](std::size_t i, std::vector<WeakGroup>& out) { at_vertex(corners.link(i), rules, rule, out); });
  detail::gather(team, cells.count(), kChunk, groups, [&](std::size_t cell, std::vector<WeakGroup>& out) {
    if (cells.shape(cell) == Shape::Tetrahedron && rule.wanted[cell])
      along_edges(mesh, cells, static_cast<std::int32_t>(cell), tables, rules, rule, sign, out);
  });
  return groups;
}

}  // namespace varimesh
