// The part of a mesh that one rank has: a range of its cells, in the order of the file.
#pragma once

#include <cstdint>
#include <vector>

#include "core/formats/gmsh/parted_file.h"
#include "core/mesh/high_order_mesh.h"
#include "core/ranks/ranks.h"

namespace varimesh {

struct Part {
  /// The cells, a range of the elements of one dimension less, and the nodes of both. It has the dimension and the
  /// order of the whole mesh.
  HighOrderMesh mesh;
  std::int64_t first_cell = 0;       ///< The place of its first cell among all cells.
  std::vector<std::int64_t> places;  ///< The place of each node among all nodes of the file.
};

/// The range of rank `rank` if `count` ranks share `total` things.
formats::ElementRange range_of_rank(std::int64_t total, int rank, int count);

/// Reads the part of this rank. Parts begin where batches of cells do, so that the cells get the same bits as in the
/// whole mesh. Errors: BadInput.
Expected<Part> read_part(const formats::PartedFile& file, const Ranks& ranks, int threads);

}  // namespace varimesh
