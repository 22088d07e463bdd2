// How far each boundary element of a mesh lies from its geometry, before and after its nodes slid. Internal to the
// library.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/slide/slide_report.h"

namespace varimesh {
namespace geometry {
struct Geometry;
}  // namespace geometry

/// One surface of the geometry and the elements of the mesh that were made on it.
struct SurfaceDistance {
  int surface = 0;            ///< geometry::Surface::tag.
  std::string name;           ///< geometry::Surface::name.
  std::vector<int> tags;      ///< The mesh's surfaces that matched it, sorted.
  std::int64_t elements = 0;  ///< How many elements these have.
  BoundaryDistance before, after;
  std::int64_t folded_before = 0, folded_after = 0;  ///< How many of them are folded over at a sample.

  /// "surface 5", or "surface 5 'Fillet'".
  std::string text() const;
};

/// The distance of every boundary element to the surface on which it was made, in the mesh's unit of length. It is
/// sampled as BoundaryDistance is: also between the nodes.
struct BoundaryDistances {
  double size = 0;                               ///< The diagonal of the box around the mesh's nodes.
  std::vector<SurfaceDistance> surfaces;         ///< The largest distance afterwards first.
  std::vector<std::int64_t> elements;            ///< Their numbers in the file, in its order.
  std::vector<std::int32_t> surface_of_element;  ///< Index in `surfaces`.
  /// By element: the largest distance. If the mesh is not known as it came, `before` is empty, and so are the fields
  /// `before` and `folded_before` of all surfaces.
  std::vector<float> before, after;

  /// Sentences for a person: the surfaces from which the boundary is farthest, and those with folded elements.
  std::vector<std::string> sentences() const;
  void forget_before();
};

/// Measures the elements of all surfaces that match.
/// @param mesh          as it came
/// @param after         the coordinates of its nodes after they slid
/// @param smooth_angle  in degrees, as GeometryOptions has it: elements that crossed a joint are measured on the
///                      surfaces that it joins
/// Errors: as associate(). Call it inside team.run().
Expected<BoundaryDistances> boundary_distances(const HighOrderMesh& mesh, const std::vector<double>& after,
                                               const geometry::Geometry& geometry, double smooth_angle,
                                               const Team& team);

}  // namespace varimesh
