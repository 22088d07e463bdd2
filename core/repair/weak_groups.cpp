// Goes through fixed vertices and through cells with two fixed faces.
#include "core/repair/weak_groups.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <queue>

#include "core/base/index.h"
#include "core/diagnosis/link_margin.h"
#include "core/diagnosis/vertex_corners.h"
#include "core/reference/basis.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

/// A straight-sided tetrahedron with a mean ratio below this is flat: 1 is regular, and a sliver of dihedral angles of
/// 1° has about 0.05.
constexpr double kFlat = 1e-2;

SplitPlace sorted(SplitPlace face) {
  std::ranges::sort(face);
  return face;
}

SplitPlace edge_place(std::int32_t a, std::int32_t b) { return {std::min(a, b), std::max(a, b), -1}; }

int size(const SplitPlace& place) { return place[2] < 0 ? 2 : 3; }

bool has(std::span<const std::int32_t> vertices, const SplitPlace& place) {
  for (int k = 0; k < size(place); ++k)
    if (std::ranges::find(vertices, place[at(k)]) == vertices.end()) return false;
  return true;
}

/// Mean ratio 12 (3 V)^(2/3) / Σ l², with the sign of V.
double mean_ratio(const Eigen::Matrix<double, 4, 3>& x) {
  Eigen::Matrix3d edges;
  for (int i = 0; i < 3; ++i) edges.row(i) = x.row(i + 1) - x.row(0);
  const double volume = edges.determinant() / 6;
  double squares = 0;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < i; ++j) squares += (x.row(i) - x.row(j)).squaredNorm();
  return squares > 0 ? std::copysign(12 * std::pow(3 * std::abs(volume), 2.0 / 3) / squares, volume) : 0;
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// What may be split
// ---------------------------------------------------------------------------------------------------------------------

SplitRules::SplitRules(const HighOrderMesh& mesh, const Cells& cells, const std::vector<bool>& fixed)
    : mesh_(mesh), cells_(cells), fixed_(fixed), first_(mesh.node_count() + 1, 0), sign_(detail::orientation(mesh)) {
  const Facets facet = facets(mesh);
  for (std::size_t c = 0; c < cells.count(); ++c) {
    const auto all = reference::info(cells.shape(c)).facets;
    for (std::size_t f = 0; f < all.size(); ++f) {
      if (facet.neighbour[at(facet.first[c]) + f] >= 0) continue;
      std::vector<std::int32_t> corners;
      for (const std::int8_t v : all[f].vertices)
        if (v >= 0) corners.push_back(cells.nodes(c)[at(v)]);
      hold(corners);
    }
  }
  for (const ElementBlock& block : mesh.blocks) {
    const auto& info = reference::info(block.shape);
    if (info.dimension == 0 || info.dimension == 3) continue;
    const std::size_t stride = at(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e) hold(std::span(block.nodes).subspan(e * stride, at(info.vertices)));
  }
  const auto for_each_corner = [&](auto&& visit) {
    for (std::size_t c = 0; c < cells.count(); ++c)
      for (int v = 0; v < reference::info(cells.shape(c)).vertices; ++v)
        visit(at(cells.nodes(c)[at(v)]), static_cast<std::int32_t>(c));
  };
  for_each_corner([&](std::size_t node, std::int32_t) { ++first_[node + 1]; });
  for (std::size_t n = 0; n < mesh.node_count(); ++n) first_[n + 1] += first_[n];
  cells_of_.resize(first_.back());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for_each_corner([&](std::size_t node, std::int32_t cell) { cells_of_[next[node]++] = cell; });
  for (std::size_t vertices = 1; vertices < middle_.size(); ++vertices) middle_[vertices] = basis_at_centre(vertices);
}

void SplitRules::hold(std::span<const std::int32_t> corners) {
  if (corners.size() == 3) faces_.insert(sorted({corners[0], corners[1], corners[2]}));
  for (std::size_t k = 0; k < corners.size(); ++k)
    edges_.insert(std::minmax(corners[k], corners[(k + 1) % corners.size()]));
}

Eigen::RowVectorXd SplitRules::basis_at_centre(std::size_t vertices) const {
  reference::Points centre = reference::Points::Zero(1, 3);
  double count = 0;
  for (std::size_t v = 0; v < 4; ++v) {
    if ((vertices >> v & 1) == 0) continue;
    ++count;
    for (int c = 0; c < 3; ++c) centre(0, c) += reference::info(Shape::Tetrahedron).vertex[v][at(c)];
  }
  centre /= count;
  return reference::basis_values(Shape::Tetrahedron, mesh_.order, reference::NodeSet::Equispaced, 3, centre).row(0);
}

bool SplitRules::is_boundary(SplitPlace face) const { return faces_.contains(sorted(face)); }

std::vector<std::int32_t> SplitRules::cells_round(const SplitPlace& place) const {
  std::vector<std::int32_t> result;
  for (std::uint32_t i = first_[at(place[0])]; i < first_[at(place[0]) + 1]; ++i) {
    const auto cell = at(cells_of_[i]);
    const auto vertices = at(reference::info(cells_.shape(cell)).vertices);
    if (has(cells_.nodes(cell).first(vertices), place)) result.push_back(cells_of_[i]);
  }
  return result;
}

bool SplitRules::may_split(const SplitPlace& place) const {
  if (size(place) == 2 ? edges_.contains({place[0], place[1]}) : faces_.contains(place)) return false;
  const std::vector<std::int32_t> round = cells_round(place);
  return !round.empty() && std::ranges::all_of(round, [&](std::int32_t cell) { return may_cut(cell, place); });
}

bool SplitRules::may_cut(std::int32_t cell, const SplitPlace& place) const {
  if (cells_.shape(at(cell)) != Shape::Tetrahedron) return false;
  const auto nodes = cells_.nodes(at(cell));
  std::vector<int> local;
  for (int k = 0; k < size(place); ++k)
    local.push_back(static_cast<int>(std::ranges::find(nodes.first(4), place[at(k)]) - nodes.begin()));
  const auto& lattice = reference::lattice(Shape::Tetrahedron, mesh_.order);
  Eigen::MatrixXd x(static_cast<Eigen::Index>(nodes.size()), 3);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const std::array<int, 4> weight{mesh_.order - lattice[n][0] - lattice[n][1] - lattice[n][2], lattice[n][0],
                                    lattice[n][1], lattice[n][2]};
    const bool gone = std::ranges::all_of(local, [&](int v) { return weight[at(v)] > 0; });
    if (gone && fixed_[at(nodes[n])]) return false;
    for (int c = 0; c < 3; ++c) x(static_cast<Eigen::Index>(n), c) = mesh_.coordinates[3 * at(nodes[n]) + at(c)];
  }
  const Eigen::Matrix<double, 4, 3> corners = x.topRows<4>();
  if (sign_ * mean_ratio(corners) < kFlat) return false;
  std::size_t bits = 0;
  for (const int v : local) bits |= std::size_t{1} << v;
  const Eigen::RowVector3d middle = middle_[bits] * x;
  return std::ranges::all_of(local, [&](int v) {
    Eigen::Matrix<double, 4, 3> part = corners;
    part.row(v) = middle;
    return sign_ * mean_ratio(part) >= kFlat / 4;
  });
}

// ---------------------------------------------------------------------------------------------------------------------
// Weak groups
// ---------------------------------------------------------------------------------------------------------------------

namespace {

void add_unique(std::vector<SplitPlace>& places, const SplitPlace& place) {
  if (std::ranges::find(places, place) == places.end()) places.push_back(place);
}

/// The edge, or else the face, where it may be split.
void add_candidate(const SplitRules& rules, const SplitPlace& edge, const SplitPlace& face,
                   std::vector<SplitPlace>& candidates) {
  if (rules.may_split(edge))
    add_unique(candidates, edge);
  else if (rules.may_split(face))
    add_unique(candidates, face);
}

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
      const SplitPlace face = sorted({link.node, a, b});
      if (!rules.is_boundary(face)) add_candidate(rules, edge_place(a, b), face, group.candidates);
    }
    if (!group.candidates.empty()) out.push_back(std::move(group));
  }
}

/// Derivatives along an edge and into the two faces on it, at points of the edge.
struct EdgeTable {
  int a, b, c, d;  // the edge, and the third vertex of each face
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
      // Counter-clockwise, so that the determinant is positive where the cell is.
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

double edge_margin(const EdgeTable& table, const Eigen::MatrixXd& x, double sign) {
  const Eigen::MatrixXd t = table.derivative[0] * x, c = table.derivative[1] * x, d = table.derivative[2] * x;
  double result = 1;
  for (Eigen::Index i = 0; i < t.rows(); ++i) {
    // Into a face: what is left of the derivative across the edge.
    const Eigen::RowVector3d along = t.row(i).normalized();
    const Eigen::RowVector3d into_c = (c.row(i) - c.row(i).dot(along) * along).normalized();
    const Eigen::RowVector3d into_d = (d.row(i) - d.row(i).dot(along) * along).normalized();
    result = std::min(result, sign * along.dot(into_c.cross(into_d)));
  }
  return result;
}

void along_edges(const HighOrderMesh& mesh, const Cells& cells, std::int32_t cell, const std::vector<EdgeTable>& tables,
                 const SplitRules& rules, const WeakRule& rule, double sign, std::vector<WeakGroup>& out) {
  const auto nodes = cells.nodes(at(cell));
  std::array<bool, 4> boundary{};  // the face opposite each vertex
  for (std::size_t v = 0; v < 4; ++v)
    boundary[v] = rules.is_boundary({nodes[(v + 1) % 4], nodes[(v + 2) % 4], nodes[(v + 3) % 4]});
  if (std::ranges::count(boundary, true) < 2) return;
  Eigen::MatrixXd x(static_cast<Eigen::Index>(nodes.size()), 3);
  for (std::size_t n = 0; n < nodes.size(); ++n)
    for (int c = 0; c < 3; ++c) x(static_cast<Eigen::Index>(n), c) = mesh.coordinates[3 * at(nodes[n]) + at(c)];
  for (const EdgeTable& table : tables) {
    if (!boundary[at(table.c)] || !boundary[at(table.d)]) continue;
    WeakGroup group;
    group.cells = {cell};
    group.margin = edge_margin(table, x, sign);
    if (group.margin > rule.margin) continue;
    const std::int32_t a = nodes[at(table.a)], b = nodes[at(table.b)], c = nodes[at(table.c)], d = nodes[at(table.d)];
    add_candidate(rules, edge_place(c, d), sorted({a, c, d}), group.candidates);
    if (group.candidates.empty()) add_candidate(rules, sorted({b, c, d}), sorted({b, c, d}), group.candidates);
    if (!group.candidates.empty()) out.push_back(std::move(group));
  }
}

/// Runs make(i, out) for every i and puts what comes of it in order.
template <class Make>
void gather(const Team& team, std::size_t count, std::vector<WeakGroup>& result, Make&& make) {
  constexpr std::size_t kChunk = 64;
  std::vector<std::vector<WeakGroup>> parts((count + kChunk - 1) / kChunk);
  team.for_each(static_cast<std::int32_t>(parts.size()), 1, [&](std::int32_t part) {
    for (std::size_t i = at(part) * kChunk; i < std::min(count, (at(part) + 1) * kChunk); ++i) make(i, parts[at(part)]);
  });
  for (auto& part : parts) std::ranges::move(part, std::back_inserter(result));
}

}  // namespace

std::vector<WeakGroup> weak_groups(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const SplitRules& rules,
                                   const WeakRule& rule, const Team& team) {
  const Cells cells(mesh, mesh.dimension);
  const double sign = detail::orientation(mesh);
  const detail::VertexCorners corners(mesh, cells, fixed, sign);
  const std::vector<EdgeTable> tables = edge_tables(mesh.order);
  std::vector<WeakGroup> groups;
  gather(team, corners.vertices(), groups,
         [&](std::size_t i, std::vector<WeakGroup>& out) { at_vertex(corners.link(i), rules, rule, out); });
  gather(team, cells.count(), groups, [&](std::size_t cell, std::vector<WeakGroup>& out) {
    if (cells.shape(cell) == Shape::Tetrahedron && rule.wanted[cell])
      along_edges(mesh, cells, static_cast<std::int32_t>(cell), tables, rules, rule, sign, out);
  });
  return groups;
}

std::vector<SplitPlace> choose_splits(std::span<const WeakGroup> groups, const SplitRules& rules) {
  struct Candidate {
    std::vector<std::size_t> groups;
    std::vector<std::int32_t> cells;
  };
  std::map<SplitPlace, Candidate> candidates;
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (const SplitPlace& place : groups[g].candidates) candidates[place].groups.push_back(g);
  for (auto& [place, candidate] : candidates) candidate.cells = rules.cells_round(place);
  std::vector<bool> covered(groups.size(), false);
  std::set<std::int32_t> taken;
  const auto rate = [&](const SplitPlace& place, const Candidate& candidate) {
    if (std::ranges::any_of(candidate.cells, [&](std::int32_t cell) { return taken.contains(cell); })) return 0.0;
    const auto gained = std::ranges::count_if(candidate.groups, [&](std::size_t g) { return !covered[g]; });
    return static_cast<double>(gained) / static_cast<double>(candidate.cells.size() * at(size(place) - 1));
  };
  // Rates only fall: what comes out on top with a rate that still holds is the best. Equals go by place.
  struct Entry {
    double rate;
    SplitPlace place;
    bool operator<(const Entry& other) const { return rate != other.rate ? rate < other.rate : place > other.place; }
  };
  std::priority_queue<Entry> queue;
  for (const auto& [place, candidate] : candidates) queue.push({rate(place, candidate), place});
  std::vector<SplitPlace> result;
  while (!queue.empty()) {
    const Entry top = queue.top();
    queue.pop();
    const Candidate& candidate = candidates[top.place];
    const double now = rate(top.place, candidate);
    if (now <= 0) continue;
    if (now < top.rate) {
      queue.push({now, top.place});
      continue;
    }
    result.push_back(top.place);
    for (const std::size_t g : candidate.groups) covered[g] = true;
    taken.insert(candidate.cells.begin(), candidate.cells.end());
  }
  return result;
}

}  // namespace varimesh
