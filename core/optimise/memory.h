// How much memory an optimisation will take, before it takes any.
#pragma once

#include <cstdint>

#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"

namespace varimesh {

/// An upper estimate of the bytes that optimise() has in use at any time, including the input mesh and the result. It
/// is the sum over the arrays that a run may keep, plus a share for temporary ones. On meshes of some thousand cells
/// and more it is 1.3 to 1.8 times the measured value. It is highest for a mesh that never needs a sweep, because
/// sweeps keep arrays that Newton's method does without. The program itself takes some tens of MB more.
std::int64_t memory_needed(const HighOrderMesh& mesh, const Options& options);

}  // namespace varimesh
