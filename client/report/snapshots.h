// The mesh before and after an optimisation: the same cells, with two sets of coordinates and qualities.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/quality/quality.h"

namespace varimesh::client {

/// One state of the mesh, with the quality of its cells.
struct Snapshot {
  std::shared_ptr<const HighOrderMesh> mesh;
  std::vector<std::int32_t> order;  ///< order[c] is the cell of this mesh that has the number of cell c of the first.
  std::vector<double> scaled_jacobian;  ///< Indexed by the cells of the first snapshot.
};

/// One snapshot, or two with the same cells. Cells are indexed as in the first, and matched by their numbers.
class Snapshots {
 public:
  /// `after` may be null. Errors: BadInput if the quality of a mesh cannot be computed, or the two meshes do not have
  /// the same cells.
  static Expected<Snapshots> create(std::shared_ptr<const HighOrderMesh> before,
                                    std::shared_ptr<const HighOrderMesh> after);

  std::size_t count() const { return snapshots_.size(); }
  const Snapshot& operator[](std::size_t snapshot) const { return snapshots_[snapshot]; }
  /// "before" or "after". A single snapshot is "before".
  static const char* name(std::size_t snapshot) { return snapshot == 0 ? "before" : "after"; }

  const HighOrderMesh& mesh() const { return *snapshots_[0].mesh; }
  const Cells& cells() const { return cells_[0]; }
  /// x, y and z of node number `local` of a cell in a snapshot.
  std::array<double, 3> point(std::size_t snapshot, std::size_t cell, int local) const;
  /// The mean of the cell's nodes. In a curved cell this usually lies inside, unlike the mean of the vertices.
  std::array<double, 3> middle(std::size_t snapshot, std::size_t cell) const;
  /// The longest distance from the cell's first node to another of its nodes.
  double size(std::size_t snapshot, std::size_t cell) const;
  /// The middle of box(). The positions in the page are relative to it, so that single precision is enough.
  const std::array<double, 3>& centre() const { return centre_; }
  /// The bounding box of the cells of the first mesh: smallest x, y, z, largest x, y, z.
  const std::array<double, 6>& box() const { return box_; }
  /// The `most` cells with the smallest scaled Jacobians in a snapshot, worst first.
  std::vector<std::int32_t> worst(std::size_t snapshot, std::size_t most) const;

 private:
  std::vector<Snapshot> snapshots_;
  std::vector<Cells> cells_;
  std::array<double, 3> centre_{};
  std::array<double, 6> box_{};
};

}  // namespace varimesh::client
