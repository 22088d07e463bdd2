// What reading changed in a mesh.
#pragma once

#include <string>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// Sentences about what reading changed in a mesh: serendipity elements that became complete, and elements that were
/// raised to the order of the others (complete_elements()). Writing uses what it needs of it by itself.
std::vector<std::string> reading_notes(const HighOrderMesh& mesh);

/// From now on, writers give elements that were raised their own order again, where this loses nothing
/// (at_own_orders()) and the format can hold elements of several orders. left_out() says which stay raised. Returns
/// whether any element was raised.
bool keep_orders(HighOrderMesh& mesh);

}  // namespace varimesh::formats
