// What a mesh file goes through before it is sent: the curved boundary put on a straight mesh.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "client/client.h"
#include "core/base/error.h"

namespace varimesh::client {

/// A mesh and, where its boundary is not in it, where that is.
struct Input {
  std::string mesh;
  std::string displacements;  ///< File of displacements of boundary nodes; empty: none.
  std::string boundary;       ///< Mesh file with the curved boundary alone; empty: none.
};

/// Adds the positional IN, --displacements and --boundary.
void add_input(CLI::App& command, Input* input);

/// Brings the mesh to the server, with its boundary put where the other files say.
Outcome<v1::StoredMesh> upload(Client& client, const Input& input);

}  // namespace varimesh::client
