#include "client/report/face_distances.h"

#include <algorithm>
#include <unordered_map>

#include "core/reference/nodes.h"

namespace varimesh::client {
namespace {

/// Sorts the first `count` nodes that node(i) names.
template <class Node>
std::array<std::int32_t, 4> sorted(int count, const Node& node) {
  std::array<std::int32_t, 4> corners{-1, -1, -1, -1};
  for (int i = 0; i < count; ++i) corners[static_cast<std::size_t>(i)] = node(static_cast<std::size_t>(i));
  std::sort(corners.begin(), corners.begin() + count);
  return corners;
}

int corner_count(Shape face) { return face == Shape::Triangle ? 3 : 4; }

}  // namespace

FaceDistances::FaceDistances(const Snapshots& snapshots, const BoundaryDistanceArrays& distances)
    : snapshots_(snapshots), distances_(distances) {
  std::unordered_map<std::int64_t, std::ptrdiff_t> place_of_number;
  for (std::size_t i = 0; i < distances.numbers.size(); ++i)
    place_of_number.emplace(distances.numbers[i], static_cast<std::ptrdiff_t>(i));
  for (const ElementBlock& block : snapshots.mesh().blocks) {
    if (reference::info(block.shape).dimension != 2) continue;
    const std::size_t stride = block.nodes.size() / std::max<std::size_t>(block.size(), 1);
    for (std::size_t e = 0; e < block.size(); ++e)
      if (const auto at = place_of_number.find(block.numbers[e]); at != place_of_number.end())
        place_of_.emplace(sorted(corner_count(block.shape), [&](std::size_t i) { return block.nodes[e * stride + i]; }),
                          at->second);
  }
}

std::ptrdiff_t FaceDistances::place(std::size_t cell, int facet) const {
  const Cells& cells = snapshots_.cells();
  const auto& local = reference::facet_nodes(cells.shape(cell), snapshots_.mesh().order, facet);
  const Shape shape = reference::info(cells.shape(cell)).facets[static_cast<std::size_t>(facet)].shape;
  const auto nodes = cells.nodes(cell);
  const auto at = place_of_.find(
      sorted(corner_count(shape), [&](std::size_t i) { return nodes[static_cast<std::size_t>(local[i])]; }));
  return at == place_of_.end() ? -1 : at->second;
}

std::int32_t FaceDistances::surface(std::size_t cell, int facet) const {
  const std::ptrdiff_t at = place(cell, facet);
  return at < 0 ? -1 : distances_.surfaces[static_cast<std::size_t>(at)];
}

float FaceDistances::distance(std::size_t snapshot, std::size_t cell, int facet) const {
  const std::ptrdiff_t at = place(cell, facet);
  return at < 0 ? -1 : distances_.distances[snapshot][static_cast<std::size_t>(at)];
}

}  // namespace varimesh::client
