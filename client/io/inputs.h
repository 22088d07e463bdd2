// The input of a job: a mesh file, and files that give the mesh its curved boundary before it is sent.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/parser.h"
#include "client/client.h"
#include "core/base/error.h"
#include "core/formats/formats.h"
#include "core/slide/slide_on_file.h"

namespace varimesh::client {

/// Paths of the files that make up an input.
struct Input {
  std::string mesh;
  std::string displacements;      ///< A file of displacements of boundary nodes; empty: none.
  std::string boundary;           ///< A mesh file with only the curved boundary; empty: none.
  GeometryOptions geometry;       ///< What the boundary nodes slide on; no file: nothing.
  double time_limit = 0;          ///< Of the job and the sliding in this process, in seconds; 0: none.
  bool keeps_as_it_came = false;  ///< Whether moved_mesh() keeps the mesh before nodes slid, for the report.
};

/// Adds the positional argument IN, and the flags --displacements and --boundary.
void add_input(Command command, Input* input);
/// The same for several meshes, whose paths go to `meshes`; `input` gets the rest.
void add_inputs(Command command, std::vector<std::string>* meshes, Input* input);

/// Adds the flags --geometry, --slide and --snap.
void add_geometry_flags(Command command, GeometryOptions* geometry);
/// Adds the flag --slide-on, which does without a geometry.
void add_slide_on_flag(Command command, GeometryOptions* geometry);
/// Adds --slide and --snap, for commands that always have a geometry.
void add_slide_flags(Command command, GeometryOptions* geometry);

/// Adds the label "file" with the name of the mesh file, unless the user has given one. Lists of jobs show it. A name
/// that is too long for a label loses its beginning.
void add_file_label(const std::string& path, google::protobuf::Map<std::string, std::string>* labels);

/// The input with the options of the job that concern its geometry too. Errors: BadOption if an option does not go with
/// a geometry, or if only a geometry gives a flag a meaning.
Expected<Input> with_options(Input input, const v1::Options& options);

/// Leaves the sliding on the model in the input's CAD file to the server, if it does that: uploads the file, takes the
/// geometry out of the input, and returns what goes into JobSpec.geometry. Nothing if there is no such file, if the
/// mesh is to be curved, or, after a sentence, if the server takes no geometries; then the nodes slide in this process.
Outcome<std::optional<v1::Geometry>> hand_over_geometry(Client& client, Input* input,
                                                        const std::function<void(const std::string&)>& on_sentence);

/// A mesh whose boundary nodes were moved in this process.
struct MovedMesh {
  formats::MeshFile file;
  /// Before nodes slid on a CAD model, if Input::keeps_as_it_came. Null if there was no model, or if the mesh was
  /// curved.
  std::shared_ptr<const HighOrderMesh> as_it_came;
  std::optional<v1::GeometryReport> geometry;  ///< If there was a CAD model: what came of it.
  double seconds = 0;                          ///< How long sliding took, with the reading of the model.
};

/// The input's mesh after its boundary nodes have been moved as the other files say; nothing if there are none. If
/// nodes slide, they do so in this process; `on_sentence` gets what this came to.
Outcome<std::optional<MovedMesh>> moved_mesh(const Input& input,
                                             const std::function<void(const std::string&)>& on_sentence = {});

/// Uploads the mesh of the input as it is, or as moved_mesh() made it. `on_read` is called when the input has been
/// found and pipes have been read to their end, so that from then on nothing but the upload is waited for.
Outcome<v1::StoredMesh> upload(Client& client, const Input& input, const std::optional<MovedMesh>& moved,
                               const std::function<void()>& on_read = {});
/// Both of them.
Outcome<v1::StoredMesh> upload(Client& client, const Input& input, const std::function<void()>& on_read = {},
                               const std::function<void(const std::string&)>& on_sentence = {});

}  // namespace varimesh::client
