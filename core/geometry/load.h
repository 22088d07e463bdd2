// Reads CAD files. The program that reads them, OpenCASCADE, is not linked: it is in a plugin that is loaded when a
// file is given. Internal to the library.
#pragma once

#include <string>

#include "core/base/error.h"
#include "core/geometry/geometry.h"

namespace varimesh::geometry {

/// Reads a STEP, IGES or BREP file with the plugin libvarimesh_opencascade.so. STEP and IGES come in millimetres,
/// whatever the file's own unit is; BREP has no unit. All bodies of the file are read. A process of its own reads the
/// file first (varimesh_cad_reader, beside the plugin), so that a file on which OpenCASCADE crashes is refused as any
/// other. Errors: BadInput if the file cannot be read or has no surface; BadOption if the plugin is not installed, with
/// what to install.
Expected<Geometry> load(const std::string& path);

/// Where load() looks for the plugin, in this order: the file that the environment variable VARIMESH_OPENCASCADE names,
/// the folder of the running program, and ../lib/varimesh beside it. Empty if there is none.
std::string plugin_path();

}  // namespace varimesh::geometry
