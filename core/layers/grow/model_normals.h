// The normals that a CAD model has on the walls of a mesh. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>

#include "core/association/association.h"
#include "core/geometry/closest_point.h"
#include "core/mesh/connectivity.h"

namespace varimesh::detail {

/// Finds the normal of the surface, or in the plane of the curve, on which an element of a wall lies. A straight
/// element of a sphere has another normal than the sphere has at its vertices.
class ModelNormals {
 public:
  /// Keeps references to all.
  /// @param elements  of one dimension less than the mesh
  /// @param model     the mesh with its model; null: there is none
  ModelNormals(const HighOrderMesh& mesh, const Cells& elements, const Association* model);

  /// The unit normal at a node of an element on the side of `like`, the element's own unit normal there. It is `like`
  /// if there is no model, if the element lies on no surface or curve of the model for sure, and where that has no
  /// normal.
  Eigen::Vector3d at(std::int32_t element, std::int32_t node, const Eigen::Vector3d& like) const;

 private:
  Eigen::Vector3d of_curve(std::int32_t element, std::int32_t node) const;
  Eigen::Vector3d of_surface(std::int32_t element, std::int32_t node) const;

  const HighOrderMesh& mesh_;
  const Cells& elements_;
  const Association* model_;
  std::map<int, geometry::CurveSearch> curves_;  ///< Of a plane model.
};

}  // namespace varimesh::detail
