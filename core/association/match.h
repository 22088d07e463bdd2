// Matches the surfaces of a mesh with those of a geometry. Internal to core/association.
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/association/association.h"
#include "core/association/repeated.h"
#include "core/geometry/closest_point.h"

namespace varimesh::detail {

/// By node of the mesh: the sorted tags of the surfaces whose elements it belongs to.
using NodeSurfaces = std::vector<std::vector<int>>;
NodeSurfaces surface_tags_by_node(const HighOrderMesh& mesh);

/// By node of the mesh: whether it lies on an edge of only one surface element. There the elements end, so such a node
/// may not move across the surface.
std::vector<bool> border_nodes(const HighOrderMesh& mesh);

/// The surfaces of a geometry, ready for the question which of them points lie on. They refer to the geometry.
class Candidates {
 public:
  /// @param part_of  Repeated::part_of. Call it inside team.run().
  Candidates(const geometry::Geometry& geometry, std::vector<std::vector<int>> part_of, const Team& team);

  std::size_t count() const { return searches_.size(); }
  const geometry::Surface& surface(std::size_t s) const { return geometry_.surfaces[s]; }
  geometry::SurfaceFoot closest(std::size_t s, const Eigen::Vector3d& x) const { return searches_[s]->closest(x); }
  /// Whether a box around the surface contains the point.
  bool may_contain(std::size_t s, const Eigen::Vector3d& x) const { return boxes_[s].contains(x); }
  /// Whether a point of the surface's plane or other shape lies inside its boundary, or not farther from it than this.
  bool holds(std::size_t s, const Eigen::Vector3d& x, double tolerance) const;
  /// Whether these are the nodes of a border that is the surface's own: each lies on one of its curves, and each of its
  /// curves but a seam has some of them.
  bool is_border(std::size_t s, std::span<const Eigen::Vector3d> nodes, double tolerance) const;
  /// Leaves out each surface that contains another one of these.
  void keep_parts(std::vector<int>& surfaces) const;

 private:
  const geometry::Geometry& geometry_;
  std::vector<std::vector<int>> part_of_;
  std::vector<std::unique_ptr<geometry::SurfaceSearch>> searches_;
  std::vector<std::unique_ptr<geometry::CurveSearch>> curves_;
  std::vector<Eigen::AlignedBox3d> boxes_;
};

/// What lies on what.
struct Matching {
  std::vector<SurfaceMatch> matches;                 ///< One entry per surface of the mesh, by increasing tag.
  std::vector<std::vector<int>> surface_of_element;  ///< As Association has it.
  std::int64_t matched = 0;                          ///< How many elements lie on a surface.
};

/// Matches each surface of the mesh as a whole. If that fails for one, each of its elements is matched by itself.
/// @param tolerance in the mesh's unit of length. Call it inside team.run().
Matching match_surfaces(const HighOrderMesh& mesh, const NodeSurfaces& tags, const Candidates& candidates,
                        double tolerance, const Team& team);

/// Matches elements of surfaces of the mesh one by one. An element lies on the surface on which all its nodes lie,
/// which has its vertices and its middle inside, and which runs in its direction there. If there is none, the middle
/// may lie outside: an edge across a coarse ring crosses its hole. Elements that lie on no surface keep what they have.
/// @param tags  of the surfaces of the mesh, sorted
/// Call it inside team.run().
void match_elements(const HighOrderMesh& mesh, const std::vector<int>& tags, const Candidates& candidates,
                    double tolerance, const Team& team, std::vector<std::vector<int>>& surface_of_element);

/// A number with three digits.
std::string number_text(double number);

}  // namespace varimesh::detail
