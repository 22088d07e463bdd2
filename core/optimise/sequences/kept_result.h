// The result of a finished run as bytes, for the checkpoints of the runs that follow it.
#pragma once

#include <optional>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/optimise/result.h"

namespace varimesh {

/// The bytes of a result of optimise(). They leave out its connectivity, which is that of the mesh that was optimised,
/// and what concerns several runs together: `before`, `left`, `seconds`. Nothing, if the mesh was refused, has bytes
/// too.
std::vector<char> keep_result(std::optional<Result>& result);

/// Whether the bytes were those of a result for this mesh. If so, sets `result` to it.
bool take_kept(const std::vector<char>& bytes, const HighOrderMesh& mesh, std::optional<Result>& result);

}  // namespace varimesh
