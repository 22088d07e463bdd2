// A straight mesh of a CAD model, made by the program gmsh.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "core/base/error.h"

namespace varimesh::client {

struct GmshOptions {
  std::string model;          ///< A STEP, IGES or BREP file.
  double size = 0;            ///< The largest length of an edge, in the model's unit of length.
  int elements_per_turn = 0;  ///< At least this many elements around a full turn of a curved surface; 0: no limit.
  /// Bodies of the model that touch get one mesh that conforms: gmsh cuts the bodies where they meet. Otherwise each
  /// body is meshed by itself, and its nodes on the faces where it touches another are its own.
  bool joins_bodies = true;
  double most_seconds = 0;  ///< How long gmsh may take; 0: as long as it wants.
  /// Gets what gmsh does, about once a second if it changes; may be empty.
  std::function<void(const std::string&)> on_progress;
};

/// Meshes the model with tetrahedra, or with triangles if it has no body but faces, of order 1, in the unit of length
/// in which OpenCASCADE reads it. gmsh runs as a process of its own. Nothing is left at `mesh` after an error. Errors:
/// BadOption if gmsh is not in PATH or cannot be started; BadInput, with the first errors that it printed, if it fails
/// or takes too long; an empty sentence if this command was interrupted; Output if the folder takes no more files.
/// @param folder for the files that gmsh writes
/// @param mesh   where the mesh goes, as MSH 4.1
/// @return the model to which the mesh belongs: a BREP file of the pieces in the folder if gmsh has cut bodies, the
///         file of the options otherwise
Expected<std::string> mesh_with_gmsh(const GmshOptions& options, const std::filesystem::path& folder,
                                     const std::filesystem::path& mesh);

}  // namespace varimesh::client
