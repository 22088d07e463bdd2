// Meshes as typed parts: a sequence of MeshPart messages, each preceded by its length, for programs that hold theirs in
// memory.
#pragma once

#include <string_view>

#include "core/base/error.h"
#include "core/formats/formats.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::server {

/// Reads a mesh from the bytes of its parts. Nodes and elements are numbered from 1 in their order. Errors: BadInput,
/// naming the part and the byte where it begins.
Expected<HighOrderMesh> read_parts(std::string_view bytes);

/// Writes the parts, each of at most 1 MiB. Errors: Output where the sink stopped.
Expected<void> write_parts(const HighOrderMesh& mesh, const formats::Sink& sink);

}  // namespace varimesh::server
