// Which nodes must not slide, so that layers at curved walls keep their heights. Internal to the library.
#pragma once

#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// By node of the mesh: whether it belongs to a thin cell of a layer at a curved wall (columns.h). If such nodes slid
/// on the wall or on a surface that cuts the layers, such as a plane of symmetry, columns would lean, and heights would
/// change by more than the heights themselves.
///
/// Empty if the mesh has no such cells, or if one of them is not certified valid: it may need to be unfolded.
/// The result does not depend on the number of threads. Call it inside team.run().
std::vector<bool> nodes_of_thin_layers(const HighOrderMesh& mesh, const Team& team);

}  // namespace varimesh
