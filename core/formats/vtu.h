// VTK unstructured grids. Internal to core/formats.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/formats/formats.h"

namespace varimesh::formats {

/// Writes the cells of the mesh's dimension, with their fields, to a VTU file. Its points are the mesh's nodes in
/// order, and behind them those that pyramids of order 2 and more add.
Expected<void> write_vtu(const HighOrderMesh& mesh, const Sink& sink, std::span<const CellField> fields);

/// How one kind of cell is written to VTK.
struct VtkCell {
  std::uint8_t type = 0;   ///< VTK's cell type.
  std::vector<int> nodes;  ///< For each VTK node the node in Gmsh's order; −1 where there is none (pyramids).
};

/// VTK's cell for a shape and order: linear ones as VTK's own, higher ones as Lagrange cells. Pyramids of order 2 and
/// more become Lagrange hexahedra whose top face is the apex: VTK 9.1 has no Lagrange pyramid, its quadratic one lacks
/// the node in the middle of the base, and the pyramid's functions are polynomials of the same order on the hexahedron,
/// so nothing is lost.
VtkCell vtk_cell(Shape shape, int order);

/// Lattice position of each of VTK's nodes; for pyramids of order 2 and more that of the hexahedron.
std::vector<std::array<int, 3>> vtk_positions(Shape shape, int order);

}  // namespace varimesh::formats
