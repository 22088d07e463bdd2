// What reading changed in a mesh.
#pragma once

#include <string>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// Sentences about what reading changed in a mesh: serendipity elements that became complete, and elements that were
/// raised to the order of the others (complete_elements()). Writing uses what it needs of it by itself.
std::vector<std::string> reading_notes(const HighOrderMesh& mesh);

}  // namespace varimesh::formats
