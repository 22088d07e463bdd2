// What the plugin that reads CAD files exports. Both sides must be compiled from the same source. Internal to the
// library.
#pragma once

#include <string>

#include "core/geometry/geometry.h"

namespace varimesh::geometry {

/// Fills `geometry`. Returns false, with a sentence in `error`, if the file cannot be read. It throws nothing.
using ReadFile = bool(const std::string& path, Geometry& geometry, std::string& error);

/// The program beside the plugin that reads a file first: reader.cpp of core/opencascade says how it is called.
inline constexpr const char* kReaderProgram = "varimesh_cad_reader";

/// The name of the exported ReadFile, which changes with every change of Geometry or of a class in it.
inline constexpr const char* kReadFileSymbol = "varimesh_read_cad_3";

}  // namespace varimesh::geometry
