// Between the file's equispaced nodes in the user's unit of length and the solver's optimised ones in relative
// coordinates.
#pragma once

#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/optimise/cells.h"
#include "core/reference/nodes.h"

namespace varimesh {

/// The relative coordinates: (x − centre)/diagonal of the bounding box of all nodes.
struct Frame {
  std::array<double, 3> centre{};
  double diagonal = 1;
};

Frame frame_of(const HighOrderMesh& mesh);

/// Whether a cell's part (vertex, edge, face, interior) belongs to `whole` or bounds it: whether what happens to a node
/// in `part` moves equispaced nodes in `whole`.
bool in_closure(const reference::ShapeInfo& shape, reference::NodePlace part, reference::NodePlace whole);

/// Positions (mesh.dimension a node, interleaved) of the optimised nodes, relative to the frame, by exact interpolation
/// in the cells. Nodes that no cell has keep their own.
std::vector<double> positions_at_door(const HighOrderMesh& mesh, const Frame& frame);

/// The mesh's coordinates after its optimised nodes went from `before` to `after`. What did not move comes back
/// verbatim, since displacements are converted and not positions: a node's coordinates change only where a node of the
/// vertex, edge, face or cell that it lies in has moved. z of a 2-D mesh is kept.
std::vector<double> coordinates_at_door(const HighOrderMesh& mesh, const Frame& frame,
                                        const std::vector<double>& before, const std::vector<double>& after);

}  // namespace varimesh
