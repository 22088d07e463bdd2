// Whether the formats that a job writes can hold its result. Known before the job computes anything.
#pragma once

#include <span>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::server {

/// Writes one straight cell of each shape to each format, and throws the bytes away; then looks at the sides that
/// elements share. The mesh has passed the check of the run. `order`: the order of the result; 0: that of the mesh.
/// Errors: BadOption, with the sentence of the writer, if a format has no element type for a shape of this order, or
/// cannot hold how elements share their sides. Nothing depends on the places of nodes, except that two nodes at one
/// place count as one.
Expected<void> check_outputs_can_hold(const HighOrderMesh& mesh, int order, std::span<const v1::MeshFormat> formats,
                                      int threads);

}  // namespace varimesh::server
