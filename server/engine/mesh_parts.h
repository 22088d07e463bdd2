// Meshes as a sequence of MeshPart messages, each preceded by its length. Programs that have their mesh in memory send
// this format instead of a mesh file.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string_view>

#include "core/base/error.h"
#include "core/base/stop_token.h"
#include "core/formats/formats.h"
#include "core/mesh/high_order_mesh.h"
#include "varimesh/v1/mesh.pb.h"

namespace varimesh::server {

/// Reads a mesh from the bytes of its parts. Nodes and elements are numbered from 1 in the order of the parts. Errors:
/// BadInput, with the number of the part and the byte at which it begins. Takes at most formats::most_memory_to_read().
/// `stop`: if it asks to stop, reading ends soon, with an error; may be null.
Expected<HighOrderMesh> read_mesh_parts(std::string_view bytes, const StopToken* stop = nullptr);

/// Writes a mesh as parts of at most 1 MiB. Errors: Output if the sink stops, or a name is not UTF-8.
Expected<void> write_mesh_parts(const HighOrderMesh& mesh, const Sink& sink);

/// Writes the quality of each cell as parts of at most 1 MiB. Errors: Output if the sink stops.
/// @param answer_of  what is proved about a cell, by its place in the mesh's order
Expected<void> write_cell_quality(const HighOrderMesh& mesh, std::span<const double> scaled_jacobians,
                                  const std::function<v1::CellAnswer(std::size_t cell)>& answer_of, const Sink& sink);

}  // namespace varimesh::server
