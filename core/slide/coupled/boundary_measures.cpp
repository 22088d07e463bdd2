// How far the boundary lies from its geometry, and what of it is folded.
#include "core/base/index.h"
#include "core/slide/coupled/boundary_energy.h"

namespace varimesh::detail {

BoundaryEnergy::Distance BoundaryEnergy::distance(const std::vector<double>& coordinates) const {
  std::vector<Distances> on_curves(curves_.size()), on_surfaces(surfaces_.size());
  team_.for_each(static_cast<std::int32_t>(curves_.size()), 1, [&](std::int32_t c) {
    if (curves_[at(c)])
      on_curves[at(c)] = curve_distances(*association_.geometry.curves[at(c)].shape, curve_elements_[at(c)], order_,
                                         curves_[at(c)]->nodes(), coordinates);
  });
  team_.for_each(static_cast<std::int32_t>(surfaces_.size()), 1, [&](std::int32_t s) {
    if (surfaces_[at(s)])
      on_surfaces[at(s)] = surface_distances(*association_.geometry.surfaces[at(s)].shape, surface_elements_[at(s)],
                                             order_, surfaces_[at(s)]->nodes(), coordinates);
  });
  Distance all;
  for (const Distances& one : on_curves) all.curves.add(one);
  for (const Distances& one : on_surfaces) all.surfaces.add(one);
  return all;
}

std::int64_t BoundaryEnergy::folded() const {
  std::int64_t count = 0;
  for (const auto& form : surfaces_) count += form ? form->folded() : 0;
  return count;
}

std::vector<BoundaryEnergy::Element> BoundaryEnergy::elements(const std::vector<double>& coordinates) const {
  std::vector<std::vector<Element>> on_curves(curves_.size()), on_surfaces(surfaces_.size());
  team_.for_each(static_cast<std::int32_t>(curves_.size()), 1, [&](std::int32_t c) {
    for (std::size_t e = 0; curves_[at(c)] && e < curve_elements_[at(c)].size(); ++e)
      on_curves[at(c)].push_back(
          {curve_elements_[at(c)][e].nodes, false, curves_[at(c)]->is_folded(e),
           curve_distances(*association_.geometry.curves[at(c)].shape, {&curve_elements_[at(c)][e], 1}, order_,
                           curves_[at(c)]->nodes(), coordinates)});
  });
  team_.for_each(static_cast<std::int32_t>(surfaces_.size()), 1, [&](std::int32_t s) {
    for (std::size_t e = 0; surfaces_[at(s)] && e < surface_elements_[at(s)].size(); ++e)
      on_surfaces[at(s)].push_back(
          {surface_elements_[at(s)][e].nodes, true, surfaces_[at(s)]->is_folded(e),
           surface_distances(*association_.geometry.surfaces[at(s)].shape, {&surface_elements_[at(s)][e], 1}, order_,
                             surfaces_[at(s)]->nodes(), coordinates)});
  });
  std::vector<Element> all;
  for (const auto* entities : {&on_curves, &on_surfaces})
    for (const std::vector<Element>& entity : *entities) all.insert(all.end(), entity.begin(), entity.end());
  return all;
}

}  // namespace varimesh::detail
