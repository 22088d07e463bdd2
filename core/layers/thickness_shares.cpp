#include "core/layers/thickness_shares.h"

#include <algorithm>

#include "core/base/index.h"
#include "core/layers/walls.h"

namespace varimesh {

Expected<std::vector<double>> thickness_of_cells(const CheckedMesh& mesh, std::span<const std::string> walls,
                                                 const ThicknessShares& shares) {
  if (shares.empty()) return std::vector<double>();
  const auto found = detail::find_walls(mesh.mesh, mesh.facets, walls);
  if (!found) return tl::unexpected(found.error());
  const Cells elements(mesh.mesh, mesh.mesh.dimension - 1);
  std::vector<double> result(mesh.mesh.element_count(mesh.mesh.dimension), 0.0);
  for (const detail::WallElement& wall : *found) {
    const auto vertices = at(reference::info(elements.shape(at(wall.element))).vertices);
    double smallest = 1;
    bool is_known = false;
    for (const std::int32_t node : elements.nodes(at(wall.element)).first(vertices))
      if (const auto share = shares.find(mesh.mesh.node_numbers[at(node)]); share != shares.end()) {
        smallest = std::min(smallest, share->second);
        is_known = true;
      }
    const auto cell = std::ranges::upper_bound(mesh.facets.first, wall.facet) - mesh.facets.first.begin() - 1;
    double& of_cell = result[at(cell)];
    if (is_known) of_cell = of_cell > 0 ? std::min(of_cell, smallest) : smallest;
  }
  return result;
}

std::vector<double> thickness_of_parts(std::span<const double> of_parents, std::span<const std::int32_t> parents) {
  std::vector<double> result;
  if (of_parents.empty()) return result;
  result.reserve(parents.size());
  for (const std::int32_t parent : parents) result.push_back(of_parents[at(parent)]);
  return result;
}

}  // namespace varimesh
