// Whether the formats that a job writes have the elements of its result. Known before the job computes anything.
#pragma once

#include <span>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::server {

/// Writes one cell of each shape to each format, and throws the bytes away. `order`: the order of the result; 0: that
/// of the mesh. Errors: BadOption, with the sentence of the writer, if a format has no element type for a shape of this
/// order.
Expected<void> check_outputs_have_types(const HighOrderMesh& mesh, int order, std::span<const v1::MeshFormat> formats);

}  // namespace varimesh::server
