// Reads CAD files. The program that reads them, OpenCASCADE, is not linked: it is in a plugin that is loaded when a
// file is given. Internal to the library.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/stop_token.h"
#include "core/geometry/cad/model_triangles.h"
#include "core/geometry/cad_reader.h"
#include "core/geometry/geometry.h"
#include "core/geometry/plugin.h"

namespace varimesh::geometry {

/// A model that a process of its own has read from its file (varimesh_cad_reader, beside the plugin), so that a file on
/// which OpenCASCADE crashes is refused as any other.
class CadModel {
 public:
  /// The entities of the model. This opens no file and starts no program, so a process that may do neither can call it.
  /// Errors: BadInput.
  Expected<Geometry> geometry() const;
  /// An estimate of the memory that they take, in bytes.
  std::int64_t memory() const;

 private:
  friend Expected<CadModel> read_model(const std::string& plugin, int file, const std::string& what,
                                       std::int64_t most_memory, const StopToken* stop);
  std::string what_, shape_;
  std::vector<std::string> notes_;
  std::map<int, std::string> names_;
  ReadShape* read_ = nullptr;
};

/// Loads the plugin and lets a process read an open STEP, IGES or BREP file.
/// @param plugin       plugin_path()
/// @param what         how sentences call the model: "The geometry 'part.step'"
/// @param most_memory  that the process may have, in bytes
/// Errors: BadInput if the file cannot be read or has no surface; BadOption if the plugin cannot be loaded.
Expected<CadModel> read_model(const std::string& plugin, int file, const std::string& what, std::int64_t most_memory,
                              const StopToken* stop = nullptr);

/// The same with the plugin of this program and the memory of this machine. Errors: BadOption, with what to install, if
/// there is no plugin.
/// @param stop  may be null. Throws Interrupted if the work is to stop
Expected<CadModel> read_model(int file, const std::string& what, const StopToken* stop = nullptr);

/// Lets a process read an open CAD file and cover its faces with triangles, for a picture. The plugin is not loaded:
/// only the program beside it is needed. Errors: as read_model().
Expected<ModelTriangles> read_triangles(const std::string& plugin, int file, const std::string& what,
                                        std::int64_t most_memory);

/// The memory for most_memory of read_model() with a file of this size, beside which a damaged file stands out.
std::int64_t memory_for_reading(std::int64_t file_bytes);

/// Reads a STEP, IGES or BREP file. STEP and IGES come in millimetres, whatever the file's own unit is; BREP has no
/// unit. All bodies of the file are read. Errors: as read_model(); BadOption, with what to install, if there is no
/// plugin.
Expected<Geometry> load(const std::string& path);

}  // namespace varimesh::geometry
