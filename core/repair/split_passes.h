// Splits a mesh pass by pass until nothing is left that needs a split. Internal to the library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/base/stop_token.h"
#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"
#include "core/repair/repair_step.h"
#include "core/repair/split_candidates.h"

namespace varimesh {

/// Called after each look for weak groups, with their number.
using OnLook = std::function<void(std::size_t groups)>;

/// Finds weak groups (split_candidates.h), chooses splits for them and splits, again and again: in each pass the mesh
/// that the last one made. Ends if no group is left that may be split, after eight passes, or if `stop` says so; a pass
/// that it interrupts splits nothing. A group is weak if its margin is at most 0.08 and it has a wanted element that is
/// not certified valid in this mesh.
///
/// `wanted` are numbers of elements, in ascending order; parts of a wanted element are wanted too. `marked` are corners
/// of the mesh that comes in; in the first pass their groups are weak whatever their margin. Adds a step to `steps` for
/// each split. Each pass calls `on_look`. Meshes that are not 3-D come back as they are. Do not call it inside
/// team.run().
HighOrderMesh split_in_passes(HighOrderMesh mesh, const Options& options, std::vector<std::int64_t> wanted,
                              std::vector<CellCorner> marked, std::vector<RepairStep>& steps, const StopToken& stop,
                              const OnLook& on_look = {});

}  // namespace varimesh
