// Elements that were raised to the order of the others when a mesh was read, at the order at which they came.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Elements of one kind that came at a lower order than others of the mesh: those with the numbers from `first` to
/// `last`.
struct CameLower {
  std::int64_t first = 0;
  std::int64_t last = 0;
  int dimension = 0;
  int order = 0;
  bool serendipity = false;
};

/// A mesh in which elements have the order at which they came.
struct OwnOrders {
  HighOrderMesh mesh;        ///< Its `order` is still the highest.
  std::int64_t lowered = 0;  ///< How many elements have a lower order again.
  std::int64_t raised = 0;   ///< How many stay raised, because their own functions do not give all of their nodes.
};

/// Gives elements the order at which they came, if their functions of that order give each of their nodes up to
/// rounding, so that nothing is lost. A boundary element, or a line, follows the cells beside it: it is lowered if one
/// of them has its order. Nodes that the lower elements have too keep their numbers; others get numbers above all
/// numbers. For a writer: everything that judges or moves a mesh needs complete_elements().
OwnOrders at_own_orders(const HighOrderMesh& mesh, const std::vector<CameLower>& came);

}  // namespace varimesh
