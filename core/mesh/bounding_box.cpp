// Each chunk of nodes has a box of its own. The boxes are joined in the order of the chunks.
#include "core/mesh/bounding_box.h"

#include <algorithm>
#include <vector>

#include "core/base/shared_work.h"

namespace varimesh {

namespace {

constexpr std::size_t kNodesPerTask = 16384;

BoundingBox box_of(const HighOrderMesh& mesh, const ElementBlock& block, const Team& team) {
  std::vector<BoundingBox> boxes(chunks_of(block.nodes.size(), kNodesPerTask));
  for_chunks(team, block.nodes.size(), kNodesPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    BoundingBox box;
    for (std::size_t i = begin; i < end; ++i)
      box.extend(mesh.coordinates.data() + 3 * static_cast<std::size_t>(block.nodes[i]));
    boxes[chunk] = box;
  });
  BoundingBox all;
  for (const BoundingBox& box : boxes) all.extend(box);
  return all;
}

}  // namespace

void BoundingBox::extend(const BoundingBox& other) {
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::min(low[k], other.low[k]);
    high[k] = std::max(high[k], other.high[k]);
  }
}

void BoundingBox::extend(const double* point) {
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::min(low[k], point[k]);
    high[k] = std::max(high[k], point[k]);
  }
}

BoundingBox bounding_box(const HighOrderMesh& mesh, const Team& team) {
  BoundingBox all;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension) all.extend(box_of(mesh, block, team));
  return all;
}

}  // namespace varimesh
