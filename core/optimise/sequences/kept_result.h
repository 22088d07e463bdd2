// The result of a finished run as bytes, for the checkpoints of the runs that follow it.
#pragma once

#include <optional>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/optimise/result.h"

namespace varimesh {

/// The bytes of a result of optimise(). They leave out the connectivity, which the optimised mesh has too, and what
/// concerns several runs together: `before`, `left`, `seconds`. There are also bytes for no result, if the mesh was
/// refused.
std::vector<char> keep_result(std::optional<Result>& result);

/// Whether the bytes were those of a result for this mesh. If so, sets `result` to it.
bool take_kept(const std::vector<char>& bytes, const HighOrderMesh& mesh, std::optional<Result>& result);

}  // namespace varimesh
