// Which cells of a mesh in parts are numbered clockwise.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/bounding_box.h"
#include "core/parts/seams.h"

namespace varimesh {

/// detail::clockwise_cells() of the cells of the part: 1 for each that is clockwise in the whole mesh; empty if none is
/// in any part. `signs` are detail::centre_signs() of the part, and `box` is that of the whole mesh. All ranks call it,
/// outside of anything that may fail.
std::vector<char> clockwise_cells(const Part& part, const Facets& facets, const detail::JoinedCells& joined,
                                  const std::vector<std::int8_t>& signs, std::int64_t first_group, const Seams& seams,
                                  const BoundingBox& box, const Ranks& ranks, const Team& team);

}  // namespace varimesh
