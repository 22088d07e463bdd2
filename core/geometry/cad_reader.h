// The program that reads a CAD file in a process of its own: where it and its plugin are, and how it is started.
// Internal to the library.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/stop_token.h"

namespace varimesh::geometry {

/// Where the plugin libvarimesh_opencascade.so is: the file that the environment variable VARIMESH_OPENCASCADE names,
/// or beside the running program, or in ../lib/varimesh. Empty if there is none.
std::string plugin_path();
/// Where the program that reads a file for the plugin at this path is, or would be.
std::string reader_path(const std::string& plugin);
/// Errors: BadOption, with what to install, if this program cannot read models, because the plugin or the program
/// beside it is missing.
/// @param what  how the sentence calls the model
Expected<void> check_plugin(const std::string& what);

/// What the program makes of a file: its shape in OpenCASCADE's binary format, or the bytes of encode() of its faces
/// (core/geometry/cad/model_triangles.h).
enum class ReaderTask { Shape, Triangles };

/// What the program has read.
struct ReadModel {
  std::string made;                  ///< As ReaderTask says.
  std::vector<std::string> notes;    ///< Sentences about what was taken, as plain text: at most 20.
  std::map<int, std::string> names;  ///< By Surface::tag: the name of the face, as plain text. At most 100,000 faces.
};

/// Reads the open file with the program `reader`. The process has limits on time and memory, and ends when this one
/// does. Of what it says, no more is kept than ReadModel states, whatever it sends.
/// @param what  how sentences call the file
/// @param stop  may be null. If it says stop, the process is ended. Throws Interrupted
/// Errors: BadInput if the file cannot be read, or if the process crashed or reached a limit; BadOption if the program
/// cannot be started.
Expected<ReadModel> read_in_child(const std::string& reader, ReaderTask task, int file, const std::string& what,
                                  std::int64_t most_memory, const StopToken* stop = nullptr);

}  // namespace varimesh::geometry
