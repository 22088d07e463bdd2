// The vertices of the edges, faces and cells of a Nektar++ file. Internal to core/formats.
#pragma once

#include <array>
#include <vector>

#include "core/formats/nektar/file.h"

namespace varimesh::formats {

struct NektarCorners {
  std::vector<std::array<std::int32_t, 4>> faces;  ///< In the order of the face's edges.
  std::vector<std::int32_t> cells;  ///< Of all cells, in Gmsh's order, in the order of Nektar++'s corners.
};

/// Finds them, replaces the vertices of edges by their positions in the file, and forgets the sides of faces and
/// elements. Throws ReadFailure if edges or faces are missing or do not fit together.
NektarCorners nektar_corners(NektarFile& file, FileAllowance& allowance);

}  // namespace varimesh::formats
