// The input of a job: a mesh file, and files that give the mesh its curved boundary before it is sent.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/parser.h"
#include "client/client.h"
#include "core/base/error.h"
#include "core/formats/formats.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::client {

/// What is put right in a mesh after it has been read: flags of every command that reads one.
struct Repairs {
  std::string node_order;  ///< The program in whose order the nodes of elements are; empty: Gmsh's.
  double merge = -1;       ///< Nodes that are at most this far apart are joined; negative: none.

  bool any() const { return !node_order.empty() || !(merge < 0); }
};

/// Adds --node-order and --merge-nodes.
void add_repair_flags(Command command, Repairs* repairs);

/// Puts the mesh right. `on_sentence` gets what this came to. Errors: BadOption; BadInput if the mesh with joined nodes
/// cannot be used.
Expected<void> repair(const Repairs& repairs, formats::MeshFile& file,
                      const std::function<void(const std::string&)>& on_sentence);

/// A sentence that names the orders of nodes in which the elements of a mesh fit together, if they do not in Gmsh's
/// order. Empty if there is none.
std::string fitting_orders_text(const formats::MeshFile& file);
/// The error of a mesh whose elements do not fit together, with fitting_orders_text() at the end of its sentence.
Error with_fitting_orders(Error error, const formats::MeshFile& file);

/// Paths of the files that make up an input.
struct Input {
  std::string mesh;
  Repairs repairs;
  std::string displacements;  ///< A file of displacements of boundary nodes; empty: none.
  std::string boundary;       ///< A mesh file with only the curved boundary; empty: none.
  std::string model;          ///< A CAD file on which boundary nodes slide; empty: none.
  v1::Geometry geometry;      ///< How boundary nodes slide, without the digest of the CAD file.
  bool keep_orders = false;   ///< Whether each element is to be written at the order at which it came.

  /// Whether the mesh that is sent is another than the file.
  bool changes_mesh() const { return repairs.any() || !displacements.empty() || !boundary.empty(); }
  /// Whether boundary nodes are to slide, or the mesh is to be curved.
  bool slides() const { return !model.empty() || geometry.slide_on() == v1::Geometry::SLIDE_ON_BOUNDARY; }
};

/// Adds the positional argument IN, and the flags --displacements, --boundary and those of Repairs.
void add_input(Command command, Input* input);
/// The same for several meshes, whose paths go to `meshes`; `input` gets the rest.
void add_inputs(Command command, std::vector<std::string>* meshes, Input* input);

/// Adds --geometry and the flags of the table of geometry options.
/// @param has_slide_on  whether --slide-on is one of them, which does without a model
void add_geometry_flags(Command command, Input* input, bool has_slide_on);

/// Adds the label "file" with the name of the mesh file, unless the user has given one. Lists of jobs show it. A name
/// that is too long for a label loses its beginning.
void add_file_label(const std::string& path, google::protobuf::Map<std::string, std::string>* labels);

/// Checks that the options of the job go with the geometry. Errors: BadOption if one does not, or if only a geometry
/// gives a flag a meaning.
Expected<void> check_geometry(const Input& input, const v1::Options& options);

/// Leaves the sliding to the job, if its server does that: uploads the CAD file, takes the geometry out of the input,
/// and returns what goes into JobSpec.geometry. Nothing if no nodes are to slide, or if the server takes no CAD models.
Outcome<std::optional<v1::Geometry>> hand_over_geometry(Client& client, Input* input);

/// Reads the mesh of the input, puts it right, and moves its boundary as the other files say.
Outcome<formats::MeshFile> read_moved(const Input& input);

/// Slides the nodes of the mesh in this process; `on_sentence` gets what this came to. For what has no job: surfaces in
/// space, and jobs of servers that take no CAD models.
Outcome<void> slide_here(const Input& input, const v1::Options& options, HighOrderMesh& mesh,
                         const std::function<void(const std::string&)>& on_sentence);

/// Uploads the mesh of the input: `moved`, or the file as it is. `on_read` is called when the input has been found and
/// pipes have been read to their end, so that from then on nothing but the upload is waited for.
Outcome<v1::StoredMesh> upload(Client& client, const Input& input, const std::optional<formats::MeshFile>& moved,
                               const std::function<void()>& on_read);
/// The same for the mesh with its boundary where the other files of the input say.
Outcome<v1::StoredMesh> upload(Client& client, const Input& input, const std::function<void()>& on_read = {});

}  // namespace varimesh::client
