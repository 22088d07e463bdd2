// The curved boundary of a mesh, and the interfaces inside it, as a geometry, on which its own nodes can slide.
// Internal to the library.
#pragma once

#include <string>
#include <vector>

#include "core/association/association.h"

namespace varimesh {

/// The boundary of a mesh as it came, and where its nodes belong.
struct OwnBoundary {
  /// A mesh of the boundary facets and of the facets on interfaces, or of the cells if the mesh is a surface. It has
  /// all nodes of the mesh, under the same indices, and one block per shape and surface.
  HighOrderMesh faces;
  /// Of `faces`. Elements between two curves are one surface, corners are vertices. `held` are boundary nodes between
  /// two regions where no elements say that there is an interface.
  Association association;
  std::size_t inside = 0;  ///< How many of the surfaces are interfaces.

  /// A sentence for a person.
  std::string sentence() const;
};

/// Two surface elements whose normals differ by more than this along their common edge, on average and in radians, meet
/// in a curve. Two edges of curves that differ by more meet in a vertex.
inline constexpr double kSmoothAngle = 0.35;
/// The same for a mesh of order 1. Its boundary is flat between its nodes, so nodes slide only in planes and along
/// straight edges, and the boundary stays what it is.
inline constexpr double kFlatAngle = 1e-6;

/// Takes the boundary and the interfaces of a mesh of dimension 3, or a surface in space, apart:
/// - A curve goes along edges at which normals differ by more than kSmoothAngle, at which the elements belong to
///   different entities of the file, or which have other than two elements: interfaces end on such edges.
/// - A vertex is where other than two such edges meet, where they meet at an angle of more than kSmoothAngle, and where
///   a surface has a tip.
/// Normals are compared on the side of the straight-sided elements, so an element that is folded over is no feature.
/// Interfaces are the elements of surfaces inside the mesh. If two regions of the file have no elements between them,
/// the boundary nodes there belong to nothing.
/// The result does not depend on the number of threads. Errors: BadInput if there is no boundary.
/// Call it inside team.run().
Expected<OwnBoundary> own_boundary(const HighOrderMesh& mesh, const Team& team);

}  // namespace varimesh
