// What the two parts of the reader of MFEM's meshes share. Internal to core/formats.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/base/io/scanner.h"
#include "core/formats/mfem/mfem.h"

namespace varimesh::formats {

/// The state of reading one file.
struct MfemReading {
  const Team& team;
  Scanner scanner;
  HighOrderMesh mesh;  ///< Its blocks have the vertices only, until the nodes are read.
  MfemNodes nodes;
  std::int32_t vertices = 0;  ///< Number of vertices.
};

/// Whether two values of a coordinate are the same, in a cell of this size: files have at least six digits, of the
/// coordinate and not of the cell's size.
inline bool is_one_place(double a, double b, double size) {
  constexpr double kOfSize = 1e-5, kOfCoordinate = 2e-6;
  return std::abs(a - b) <= std::max(kOfSize * size, kOfCoordinate * std::abs(b));
}

/// Gives cells nodes of their own where they share a vertex, edge or face, but are not at one place: a periodic mesh is
/// cut open. Both sides of the cut become boundary elements in groups of their own, and periodic links pair their
/// nodes.
/// @param places  the coordinates of the nodes of all cells, cell after cell, three numbers for each node
void cut_open(MfemReading& reading, const std::vector<double>& places);

/// Reads the numbers of the GridFunction, and makes of them the equispaced nodes of the mesh and of each element.
void read_mfem_nodes(MfemReading& reading);

}  // namespace varimesh::formats
