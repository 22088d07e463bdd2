// What a VTK file declares before its values. Internal to core/formats.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "core/formats/vtu/arrays.h"

namespace varimesh::formats {

/// The declarations of a file: everything but the values.
struct VtkDeclared {
  VtkEncoding encoding;
  int version = 0;  ///< Ten times the version: 21 is 2.1.
  std::int64_t points = -1, cells = -1;
  std::vector<VtkArray> coordinates, topology, cell_data, field_data;
};

/// Throws ReadFailure; Interrupted if reading is to stop.
VtkDeclared vtk_declared(std::string_view file, const FileAllowance& allowance);

}  // namespace varimesh::formats
