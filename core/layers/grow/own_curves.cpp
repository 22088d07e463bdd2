#include "core/layers/grow/own_curves.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/association/own_boundary.h"
#include "core/base/index.h"
#include "core/geometry/pieces.h"
#include "core/layers/facet_table.h"

namespace varimesh::detail {
namespace {

class Chains {
 public:
  Chains(const HighOrderMesh& mesh, std::span<const OuterFacet> outer)
      : mesh_(mesh),
        table_(Shape::Line, mesh.order, mesh.dimension),
        least_(std::cos(mesh.order < 2 ? kFlatAngle : kSmoothAngle)) {
    for (const OuterFacet& facet : outer)
      for (const std::int32_t vertex : facet.corners()) at_vertex_[vertex].push_back(&facet);
  }

  /// The edges of a curve that begins with this edge at this end of it, and those that were in none before.
  std::vector<const OuterFacet*> follow(const OuterFacet& first, std::int32_t from) {
    std::vector<const OuterFacet*> chain;
    for (const OuterFacet* edge = &first; edge != nullptr && known_.insert(edge).second;) {
      chain.push_back(edge);
      from = edge->nodes[0] == from ? edge->nodes[1] : edge->nodes[0];
      edge = beyond(*edge, from);
    }
    return chain;
  }

 private:
  /// The edge that goes on smoothly; null if none does.
  const OuterFacet* beyond(const OuterFacet& edge, std::int32_t vertex) const {
    const auto& around = at_vertex_.at(vertex);
    if (around.size() != 2) return nullptr;
    const OuterFacet* next = around[0] == &edge ? around[1] : around[0];
    if (next->is_wall || next->entity != edge.entity) return nullptr;
    return std::abs(normal(edge, vertex).dot(normal(*next, vertex))) >= least_ ? next : nullptr;
  }

  Eigen::Vector3d normal(const OuterFacet& edge, std::int32_t vertex) const {
    return table_.normals(mesh_, edge.nodes, edge.normal)[edge.nodes[0] == vertex ? 0 : 1];
  }

  const HighOrderMesh& mesh_;
  const FacetTable table_;
  const double least_;  ///< The cosine of the largest angle at a joint that is smooth.
  std::map<std::int32_t, std::vector<const OuterFacet*>> at_vertex_;
  std::set<const OuterFacet*> known_;
};

/// The nodes of an edge from one of its ends.
Eigen::Matrix3Xd positions(const HighOrderMesh& mesh, std::vector<std::int32_t> nodes, std::int32_t from) {
  if (nodes[0] != from) {
    std::swap(nodes[0], nodes[1]);
    std::reverse(nodes.begin() + 2, nodes.end());
  }
  Eigen::Matrix3Xd x(3, static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t k = 0; k < nodes.size(); ++k) x.col(static_cast<Eigen::Index>(k)) = point(mesh, nodes[k]);
  return x;
}

}  // namespace

Association own_curves(const HighOrderMesh& mesh, std::span<const OuterFacet> outer,
                       std::map<std::vector<std::int32_t>, int>& side) {
  Association found;
  Chains chains(mesh, outer);
  std::set<std::int32_t> on_wall;
  for (const OuterFacet& facet : outer)
    if (facet.is_wall) on_wall.insert(facet.corners().begin(), facet.corners().end());
  for (const OuterFacet& facet : outer)
    for (const std::int32_t end : facet.corners()) {
      if (facet.is_wall || !on_wall.contains(end)) continue;
      std::vector<Eigen::Matrix3Xd> pieces;
      std::int32_t from = end;
      const auto number = static_cast<int>(found.geometry.curves.size());
      for (const OuterFacet* edge : chains.follow(facet, end)) {
        pieces.push_back(positions(mesh, edge->nodes, from));
        from = edge->nodes[0] == from ? edge->nodes[1] : edge->nodes[0];
        std::vector<std::int32_t> ends(edge->nodes.begin(), edge->nodes.begin() + 2);
        std::ranges::sort(ends);
        side[ends] = number;
      }
      if (!pieces.empty())
        found.geometry.curves.push_back({number + 1, geometry::curve_of_pieces(pieces, false).shape, {}, {}});
    }
  return found;
}

}  // namespace varimesh::detail
