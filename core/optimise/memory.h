// How much memory an optimisation will take, before it takes any.
#pragma once

#include <cstdint>

#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"

namespace varimesh {

/// Bytes that optimise() has in use at most, the mesh that is handed in and its result among them: a sum over the
/// arrays that it may come to keep, and a share for those that come and go. On meshes of some thousand cells and more
/// 1.3 to 1.8 times what is measured, the most where the mesh never needs a sweep, which keeps what Newton's method
/// does without; a program's own tens of MB come on top.
std::int64_t memory_needed(const HighOrderMesh& mesh, const Options& options);

}  // namespace varimesh
