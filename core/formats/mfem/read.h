// What the two parts of the reader of MFEM's meshes share. Internal to core/formats.
#pragma once

#include <cstdint>

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

/// Reads the numbers of the GridFunction, and makes of them the equispaced nodes of the mesh and of each element.
void read_mfem_nodes(MfemReading& reading);

}  // namespace varimesh::formats
