// The types of VTK's cells that VariMesh reads. Internal to core/formats.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/reference/shape.h"

namespace varimesh::formats {

/// A cell of a VTK file.
struct VtkKind {
  Shape shape = Shape::Point;
  int order = 1;
  /// For each node in Gmsh's order, its place in the cell's list.
  const std::vector<int>* places = nullptr;
};

/// The kind of a cell from VTK's type and its number of nodes. `new_order`: the file has version 2.1 or above, in which
/// two upright edges of Lagrange hexahedra have changed places. Errors: BadInput, without the place.
Expected<VtkKind> vtk_kind(std::int64_t type, std::size_t nodes, bool new_order);

/// A pyramid of order 2 and above is a hexahedron whose top face is its apex.
VtkKind vtk_pyramid(int order, bool new_order);

}  // namespace varimesh::formats
