// Which way round a mesh is numbered. Internal to core/quality.
#pragma once

#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// −1 where most straight-sided cells have a negative Jacobian in their middle, else 1.
double orientation(const HighOrderMesh& mesh);

}  // namespace varimesh::detail
