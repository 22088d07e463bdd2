#include "core/repair/split_rules.h"

#include <algorithm>

#include "core/base/index.h"
#include "core/diagnosis/node_positions.h"
#include "core/reference/basis.h"
#include "core/repair/mean_ratio.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

/// A straight-sided tetrahedron with a mean ratio below this is flat. A regular one has 1, and a sliver with dihedral
/// angles of 1° about 0.05.
constexpr double kFlat = 1e-2;

/// Whether all vertices of the place are among these.
bool has(std::span<const std::int32_t> vertices, const SplitPlace& place) {
  for (int k = 0; k < vertex_count(place); ++k)
    if (std::ranges::find(vertices, place[at(k)]) == vertices.end()) return false;
  return true;
}

}  // namespace

SplitRules::SplitRules(const HighOrderMesh& mesh, const Cells& cells, const std::vector<bool>& fixed)
    : mesh_(mesh),
      cells_(cells),
      fixed_(fixed),
      at_vertices_(cells, mesh.node_count()),
      sign_(detail::orientation(mesh)) {
  const Facets facet = facets(mesh);
  for (std::size_t c = 0; c < cells.count(); ++c) {
    const auto all = reference::info(cells.shape(c)).facets;
    for (std::size_t f = 0; f < all.size(); ++f) {
      if (facet.neighbour[at(facet.first[c]) + f] >= 0) continue;
      std::vector<std::int32_t> corners;
      for (const std::int8_t v : all[f].vertices)
        if (v >= 0) corners.push_back(cells.nodes(c)[at(v)]);
      forbid(corners);
    }
  }
  for (const ElementBlock& block : mesh.blocks) {
    const auto& info = reference::info(block.shape);
    if (info.dimension == 0 || info.dimension == mesh.dimension) continue;
    const std::size_t stride = at(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e)
      forbid(std::span(block.nodes).subspan(e * stride, at(info.vertices)));
  }
  for (const Shape shape : {Shape::Triangle, Shape::Tetrahedron}) weights_[shape] = node_weights(shape, mesh.order);
  for (std::size_t vertices = 1; vertices < centre_basis_.size(); ++vertices)
    centre_basis_[vertices] = basis_at_centre(vertices);
}

void SplitRules::forbid(std::span<const std::int32_t> corners) {
  if (corners.size() == 3) faces_.insert(face_place(corners[0], corners[1], corners[2]));
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

bool SplitRules::is_boundary(const SplitPlace& face) const { return faces_.contains(face); }

std::vector<std::int32_t> SplitRules::cells_around(const SplitPlace& place) const {
  std::vector<std::int32_t> result;
  for (const std::int32_t cell : at_vertices_.of(place[0])) {
    const auto vertices = at(reference::info(cells_.shape(at(cell))).vertices);
    if (has(cells_.nodes(at(cell)).first(vertices), place)) result.push_back(cell);
  }
  return result;
}

bool SplitRules::is_forbidden(const SplitPlace& place) const {
  return vertex_count(place) == 2 ? edges_.contains({place[0], place[1]}) : faces_.contains(place);
}

bool SplitRules::may_split(const SplitPlace& place) const {
  if (is_forbidden(place)) return false;
  const std::vector<std::int32_t> around = cells_around(place);
  return !around.empty() && std::ranges::all_of(around, [&](std::int32_t cell) { return may_cut(cell, place); });
}

bool SplitRules::is_inside(const SplitPlace& place) const {
  if (is_forbidden(place)) return false;
  return std::ranges::all_of(cells_around(place), [&](std::int32_t cell) {
    const Shape shape = cells_.shape(at(cell));
    return (shape == Shape::Triangle || shape == Shape::Tetrahedron) && !holds_fixed_node(cell, place);
  });
}

bool SplitRules::holds_fixed_node(std::int32_t cell, const SplitPlace& place) const {
  const auto nodes = cells_.nodes(at(cell));
  const NodeWeights& weights = weights_.at(cells_.shape(at(cell)));
  const VertexNodes vertices = vertex_nodes(cells_.shape(at(cell)), nodes.data());
  const auto ends = std::span(place).first(at(vertex_count(place)));
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    bool is_held = fixed_[at(nodes[n])];
    for (std::size_t v = 0; v < 4 && is_held; ++v)
      is_held = weights[n][v] > 0 || std::ranges::find(ends, vertices[v]) == ends.end();
    if (is_held) return true;
  }
  return false;
}

bool SplitRules::may_cut(std::int32_t cell, const SplitPlace& place) const {
  if (cells_.shape(at(cell)) != Shape::Tetrahedron || holds_fixed_node(cell, place)) return false;
  const auto nodes = cells_.nodes(at(cell));
  std::vector<int> local;
  for (int k = 0; k < vertex_count(place); ++k)
    local.push_back(static_cast<int>(std::ranges::find(nodes.first(4), place[at(k)]) - nodes.begin()));
  const Eigen::MatrixXd x = detail::node_positions(mesh_.coordinates, nodes);
  const Eigen::Matrix<double, 4, 3> corners = x.topRows<4>();
  if (sign_ * mean_ratio(corners) < kFlat) return false;
  std::size_t bits = 0;
  for (const int v : local) bits |= std::size_t{1} << v;
  const Eigen::RowVector3d centre = centre_basis_[bits] * x;
  return std::ranges::all_of(local, [&](int v) {
    Eigen::Matrix<double, 4, 3> part = corners;
    part.row(v) = centre;
    return sign_ * mean_ratio(part) >= kFlat / 4;
  });
}

}  // namespace varimesh
