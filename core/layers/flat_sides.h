// The flat sides at which walls with layers end. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <unordered_map>

#include "core/layers/columns.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// A wall ends at sides, such as planes of symmetry: facets of the boundary, or of interfaces, in which an edge of a
/// column lies. On a side that is flat, nodes may move along the side, and the boundary keeps its shape. Where elements
/// of two groups or entities meet in one plane, nodes stay, so the border between the elements stays too.
class FlatSides {
 public:
  /// There are none.
  FlatSides() = default;
  FlatSides(const HighOrderMesh& mesh, const Facets& facets, const Columns& columns);

  /// Whether the node lies on flat sides, on no other part of the boundary, and in no periodic link.
  bool has(std::int32_t node) const { return at_.contains(node); }
  /// The part of a displacement of such a node that lies in its sides.
  Eigen::Vector3d along(std::int32_t node, const Eigen::Vector3d& displacement) const;

 private:
  /// The sides on which a node lies: their unit normals. A node is on two at most.
  struct Sides {
    int count = 0;
    std::array<Eigen::Vector3d, 2> normals{};
    std::array<const ElementBlock*, 2> blocks{};  ///< Of an element of each side; null: it has none.
    bool stays = false;                           ///< It is also on something that is no flat side.

    void add(const Eigen::Vector3d& normal, const ElementBlock* block);
  };

  std::unordered_map<std::int32_t, Sides> at_;
};

}  // namespace varimesh::detail
