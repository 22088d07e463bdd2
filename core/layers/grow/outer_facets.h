// The facets at which cells end, and those on interfaces. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/layers/walls.h"
#include "core/mesh/checked_mesh.h"

namespace varimesh::detail {

/// A facet of the boundary, of a wall or of an interface.
struct OuterFacet {
  Shape shape = Shape::Line;
  std::vector<std::int32_t> nodes;  ///< In Gmsh's order; the vertices come first.
  int vertices = 0;                 ///< How many.
  Eigen::Vector3d normal;           ///< Of unit length, of the facet with straight sides.
  bool is_plane = true;
  std::int32_t element = -1;  ///< Among the elements of one dimension less than the mesh; −1: it has none.
  int entity = 0;             ///< Of the element.
  bool is_wall = false;

  std::span<const std::int32_t> corners() const { return std::span(nodes).first(std::size_t(vertices)); }
};

/// Each facet once, in the order of the cells.
std::vector<OuterFacet> outer_facets(const CheckedMesh& mesh, std::span<const WallElement> walls);

}  // namespace varimesh::detail
