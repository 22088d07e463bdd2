// The normals that a CAD model has on the walls of a mesh. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/association/association.h"
#include "core/mesh/connectivity.h"

namespace varimesh::detail {

/// Finds the normal of the surface on which an element of a wall lies. A straight element of a sphere has another
/// normal than the sphere has at its vertices.
class ModelNormals {
 public:
  /// Keeps references to all.
  /// @param elements  of dimension 2 of the mesh
  /// @param model     the mesh with its model; null: there is none
  ModelNormals(const HighOrderMesh& mesh, const Cells& elements, const Association* model)
      : mesh_(mesh), elements_(elements), model_(model) {}

  /// The unit normal at a node of an element on the side of `like`, the element's own unit normal there. It is `like`
  /// if there is no model, if the element lies on no surface of the model for sure, and where the surface has no
  /// normal.
  Eigen::Vector3d at(std::int32_t element, std::int32_t node, const Eigen::Vector3d& like) const;

 private:
  const HighOrderMesh& mesh_;
  const Cells& elements_;
  const Association* model_;
};

}  // namespace varimesh::detail
