// Which entity of a geometry each boundary node of a mesh belongs to, and how far it lies from it. Internal to the
// library.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/team.h"
#include "core/geometry/geometry.h"
#include "core/geometry/pieces.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Where a node belongs.
struct NodeEntity {
  std::int8_t dimension = -1;  ///< 0: vertex, 1: curve, 2: surface; −1: none that is sure, so the node must be held.
  std::int32_t entity = -1;    ///< Index in Geometry::vertices, curves or surfaces.
  double distance = 0;         ///< To the entity, in the mesh's unit of length.
  std::array<double, 2> at{};  ///< t on a curve, (u, v) on a surface.
};

/// The nodes of all elements that lie on one surface, those of its boundary curves included.
struct SurfaceNodes {
  std::vector<std::int32_t> nodes;                ///< Sorted.
  std::vector<std::array<double, 2>> parameters;  ///< (u, v) on the surface, by node.
  /// The parameters of a node that is in `nodes`.
  std::array<double, 2>& of(std::int32_t node);
};

/// A surface of the mesh (the elements of dimension 2 with one tag) and the surface of the geometry that it covers.
struct SurfaceMatch {
  int tag = 0;          ///< Of the mesh's entity.
  int surface = -1;     ///< Index in Geometry::surfaces; −1: none fits as a whole, or more than one does.
  int rival = -1;       ///< The nearest surface, if another fits as well, so that neither is taken; −1: none.
  bool by_tag = false;  ///< The tags agree. Otherwise it was found by distance.
  double distance = 0;  ///< Largest distance of the samples to the surface, in the mesh's unit of length.
  std::int64_t elements = 0, on_none = 0;  ///< How many elements it has, and how many of them lie on no surface.
};

/// A mesh and the geometry that it was made from.
struct Association {
  geometry::Geometry geometry;        ///< In the mesh's unit of length, without what bodies repeat.
  int repeated = 0;                   ///< How many surfaces of the file were left out, because others are the same.
  double factor = 1;                  ///< Lengths in the mesh over lengths in the file of the geometry.
  double size = 0;                    ///< The diagonal of the box around the mesh's nodes.
  bool in_plane = false;              ///< The mesh lies in a plane, the only surface (plane/profile.h).
  std::vector<SurfaceMatch> matches;  ///< By increasing tag.
  std::vector<NodeEntity> nodes;  ///< By node of the mesh. Nodes that lie on no surface element have dimension −1.
  std::vector<SurfaceNodes> surfaces;  ///< By surface of the geometry.
  std::vector<std::int32_t> held;      ///< Nodes of surface elements with dimension −1.
  std::size_t by_parameters = 0;       ///< How many nodes were placed by the parameters of their file.
  std::vector<std::int32_t> misled;    ///< Nodes to which the parameters of their file do not lead.

  /// By block of elements of the mesh and by element: the index of the surface; −1 if it lies on none for sure. Empty
  /// for blocks of another dimension.
  std::vector<std::vector<int>> surface_of_element;

  /// If the geometry is the mesh's own boundary, its elements lie on it as they come, and away from it once a node has
  /// moved. By curve and surface: how far they may. Empty with another geometry: no farther than they are.
  std::vector<geometry::InterpolationError> allowed_on_curves, allowed_on_surfaces;
};

/// How far a node may lie from its entity before the entity is called wrong, relative to Association::size.
inline constexpr double kMatchTolerance = 1e-3;

/// Associates the mesh with the geometry.
///
/// Surfaces that touching bodies repeat count once. Each surface of the mesh is matched first: the surface with the
/// same tag if samples of the mesh lie on it, else the one surface on which they do. A surface fits if the samples lie
/// within kMatchTolerance of it and more than half of them inside its boundary. If several fit equally well, the only
/// one that has all samples inside is taken; or, if one of these is a part of the others, this part; or else none.
/// Where a surface of the mesh does not match as a whole, or has nodes that lie elsewhere, each of its elements is
/// matched by itself, so one tag may stand for many surfaces. A node on elements of one surface belongs to it; a node
/// on elements of several belongs to the nearest curve or vertex that bounds all of them. If the file has parameters of
/// a node and they lead to it, within 10⁻⁶ of the size, they are taken; otherwise the node is projected, because those
/// of files are often incomplete.
///
/// If the mesh and the geometry differ in size by a usual factor between units (millimetres, metres, inches, …), the
/// geometry is scaled, provided that more elements match than if it is not. Errors: BadInput if no element matches, or
/// fewer than half on a geometry that was scaled, with both sizes; and if the mesh has no elements of dimension 2. The
/// result does not depend on the number of threads. Call it inside team.run().
Expected<Association> associate(const HighOrderMesh& mesh, const geometry::Geometry& geometry, const Team& team);

/// Sentences for a person: what matched how, what did not, the largest distance of a node, and the first few nodes that
/// are farther from their entity than `tolerance` times the size.
std::vector<std::string> describe(const HighOrderMesh& mesh, const Association& association, double tolerance);

/// Moves every node of an entity that is farther from it than `tolerance` times the size to its foot. Returns how many.
std::size_t snap(HighOrderMesh& mesh, Association& association, double tolerance);

}  // namespace varimesh
