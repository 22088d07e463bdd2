// Whether the cells of a mesh share the nodes of their common edges and faces. Internal to core/formats.
#pragma once

#include <atomic>
#include <limits>
#include <optional>
#include <string_view>

#include "core/base/error.h"
#include "core/formats/mfem/topology.h"

namespace varimesh::formats {

/// Returns the first cell that has other nodes on an edge or face than the first cell with the same vertices; nothing
/// if there is none. Nodes at the same place count as the same. A continuous space cannot hold such a mesh: a file
/// would have another mesh. Call it inside team.run().
std::optional<std::size_t> find_unshared_side(const HighOrderMesh& mesh, const Cells& cells,
                                              const TopologyCells& vertices, const MfemTopology& topology,
                                              const Team& team);

/// The error about such a cell: BadOption. `format`: whose format it is, such as "MFEM's".
tl::unexpected<Error> unshared_side(const Cells& cells, std::size_t cell, std::string_view format);

/// BadOption if a cell has a node as two of its vertices. `format`: as above.
Expected<void> check_distinct_vertices(const Cells& cells, std::string_view format);

/// Whether two nodes are the same or have the same coordinates.
bool are_at_one_place(const HighOrderMesh& mesh, std::int32_t a, std::int32_t b);

/// The smallest of the cells that threads take.
class SmallestCell {
 public:
  void take(std::size_t cell);
  std::optional<std::size_t> get() const {
    const std::size_t cell = smallest_;
    return cell == kNone ? std::nullopt : std::optional(cell);
  }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::atomic<std::size_t> smallest_ = kNone;
};

}  // namespace varimesh::formats
