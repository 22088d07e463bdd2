// Makes all elements of a mesh complete and of one order, as everything that judges or moves a mesh needs them.
#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/io/allowance.h"
#include "core/mesh/changes/completion/own_orders.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// What complete_elements() did.
struct Completion {
  /// Shapes all of whose elements came as serendipity elements of the mesh's order.
  std::vector<Shape> serendipity;
  std::vector<CameLower> lower;  ///< The elements that were raised.
  /// For humans: what became of which elements, and the numbers of the new nodes. Empty if nothing had to be done.
  std::vector<std::string> sentences;
};

/// Gives serendipity elements the nodes that they lack, and raises elements of lower order to the order of the others.
/// Both leave the geometry as it is: the functions of the new elements contain those of the old ones. Nodes keep their
/// numbers and places if the new elements have them too. New nodes come last and have numbers above all others. The
/// order is the highest of the cells and boundary elements.
///
/// A side of a raised element that is curved in the element beside it follows that element; a sentence counts them.
/// Errors: BadInput if the allowance does not suffice.
Expected<Completion> complete_elements(HighOrderMesh& mesh, Allowance& allowance);

}  // namespace varimesh
