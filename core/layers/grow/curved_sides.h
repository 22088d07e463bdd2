// The curved boundaries and interfaces at which a wall ends: vertices slide on them. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <vector>

#include "core/association/association.h"
#include "core/base/team.h"
#include "core/geometry/closest_point.h"
#include "core/layers/grow/outer_facets.h"

namespace varimesh::detail {

/// A side is a smooth part of the boundary, or of an interface, that is not on a wall but ends at one: a curve in the
/// plane, a surface in space. Its shape comes from the model, or else from the mesh as it came. There are no sides if
/// all facets at which the walls end are plane.
class CurvedSides {
 public:
  /// Keeps a reference to the model. Call it inside team.run().
  /// @param model  what the mesh was made from; null: there is none
  CurvedSides(const CheckedMesh& mesh, std::span<const OuterFacet> outer, const Association* model, const Team& team);

  /// Whether a node lies on a side that is curved.
  bool has(std::int32_t node) const { return nodes_.contains(node); }
  /// Whether a node lies where a curved side meets another side.
  bool is_between(std::int32_t node) const { return has(node) && nodes_.at(node).sides.size() > 1; }

  /// The directions in which a vertex may move on its sides, orthonormal. There are none where three sides meet, and
  /// where something else ends at the vertex.
  std::vector<Eigen::Vector3d> directions(std::int32_t vertex) const;

  /// The point of the sides of a node that is nearest to a point; the point itself if the node lies on no curved side.
  Eigen::Vector3d nearest(std::int32_t node, const Eigen::Vector3d& to) const;

 private:
  struct OfNode {
    std::set<int> sides;  ///< Curves in the plane, surfaces in space, as the association numbers them.
    bool stays = false;   ///< Something that is no side ends there.
    Eigen::Vector3d x;
  };
  struct CurvePlace {
    const geometry::CurveShape* shape = nullptr;  ///< Null: there is none.
    geometry::CurveFoot foot;
  };

  void find_own(const CheckedMesh& mesh, std::span<const OuterFacet> outer, const Team& team);
  void note_nodes(const CheckedMesh& mesh, std::span<const OuterFacet> outer);
  std::vector<int> sides_of(const CheckedMesh& mesh, std::span<const OuterFacet> outer) const;
  void note_curves(const std::set<int>& sides);
  /// On the curve on which a node lies: its side in the plane, one between its two sides in space.
  CurvePlace on_curve(const OfNode& node, const Eigen::Vector3d& to) const;
  /// Where a node is on a surface; null if the association does not know.
  const std::array<double, 2>* parameters(std::int32_t node, int surface) const;

  int dimension_;
  const Association* shapes_ = nullptr;                ///< The model, or own_.
  std::shared_ptr<const Association> own_;             ///< Null if there is a model, and if there are no sides.
  std::map<std::vector<std::int32_t>, int> own_side_;  ///< By the sorted vertices of a facet.
  std::map<std::int32_t, OfNode> nodes_;               ///< Of curved sides.
  std::map<int, geometry::CurveSearch> curves_;        ///< Sides in the plane, borders between sides in space.
};

/// The curve of a plane model on which an edge of the mesh lies; −1 if none does for sure.
int curve_of_edge(const Association& model, std::int32_t one, std::int32_t other);

}  // namespace varimesh::detail
