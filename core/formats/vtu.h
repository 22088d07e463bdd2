// VTK unstructured grids. Internal to core/formats.
#pragma once

#include <cstdint>
#include <vector>

#include "core/formats/formats.h"

namespace varimesh::formats {

/// Writes the cells of the mesh's dimension, with their fields, to a VTU file.
Expected<void> write_vtu(const HighOrderMesh& mesh, const Sink& sink, std::span<const CellField> fields);

/// How one kind of cell is written to VTK.
struct VtkCell {
  std::uint8_t type = 0;   ///< VTK's cell type.
  std::vector<int> nodes;  ///< For each VTK node the number of the node in Gmsh's order.
};

/// VTK's cell for a shape and order: Lagrange cells, but linear and quadratic pyramids as VTK's own, and pyramids of
/// order 3 and more as hexahedra whose top face is the apex.
VtkCell vtk_cell(Shape shape, int order);

}  // namespace varimesh::formats
