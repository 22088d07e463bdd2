// What the plugin that reads CAD models exports. Both sides must be compiled from the same source. Internal to the
// library.
#pragma once

#include <string>
#include <string_view>

#include "core/geometry/geometry.h"

namespace varimesh::geometry {

/// Fills `geometry` from a shape in OpenCASCADE's binary format. Returns false, with a sentence in `error`, if that
/// cannot be done. It throws nothing, and opens no file.
using ReadShape = bool(std::string_view shape, Geometry& geometry, std::string& error);

/// The program beside the plugin that reads a file first: reader.cpp of core/opencascade says how it is called.
inline constexpr const char* kReaderProgram = "varimesh_cad_reader";

/// The name of the exported ReadShape, which changes with every change of Geometry or of a class in it.
inline constexpr const char* kReadShapeSymbol = "varimesh_read_shape_5";

}  // namespace varimesh::geometry
