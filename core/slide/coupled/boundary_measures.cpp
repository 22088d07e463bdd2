// How far the boundary lies from its geometry, and what of it is folded.
#include "core/base/index.h"
#include "core/slide/coupled/boundary_energy.h"

namespace varimesh::detail {

BoundaryEnergy::Distance BoundaryEnergy::distance(const std::vector<double>& coordinates) const {
  std::vector<Distances> on_curves(curves_.size()), on_surfaces(surfaces_.size());
  team_.for_each(static_cast<std::int32_t>(curves_.size()), 1, [&](std::int32_t c) {
    if (curves_[at(c)])
      on_curves[at(c)] = curve_distances(*association_.geometry.curves[at(c)].shape, curve_elements_[at(c)], order_,
                                         curves_[at(c)]->nodes(), coordinates, team_);
  });
  team_.for_each(static_cast<std::int32_t>(surfaces_.size()), 1, [&](std::int32_t s) {
    if (surfaces_[at(s)])
      on_surfaces[at(s)] = surface_distances(*association_.geometry.surfaces[at(s)].shape, surface_elements_[at(s)],
                                             order_, surfaces_[at(s)]->nodes(), coordinates, team_);
  });
  Distance all;
  for (const Distances& one : on_curves) all.curves.add(one);
  for (const Distances& one : on_surfaces) all.surfaces.add(one);
  return all;
}

std::int64_t BoundaryEnergy::folded() const {
  std::int64_t count = 0;
  for (const auto& form : surfaces_) count += form ? form->folded(team_) : 0;
  return count;
}

std::vector<BoundaryEnergy::Element> BoundaryEnergy::elements(const std::vector<double>& coordinates) const {
  std::vector<Element> all;
  const auto add = [&](const auto& forms, const auto& elements, bool are_on_surfaces, const auto& distances) {
    std::vector<std::vector<Element>> of(forms.size());
    team_.for_each(static_cast<std::int32_t>(forms.size()), 1, [&](std::int32_t i) {
      if (!forms[at(i)]) return;
      of[at(i)].resize(elements[at(i)].size());
      team_.for_each(static_cast<std::int32_t>(of[at(i)].size()), 1, [&](std::int32_t e) {
        const EntityElement& element = elements[at(i)][at(e)];
        of[at(i)][at(e)] = {element.nodes, are_on_surfaces, forms[at(i)]->is_folded(at(e)),
                            distances(at(i), std::span(&element, 1), forms[at(i)]->nodes())};
      });
    });
    for (const std::vector<Element>& entity : of) all.insert(all.end(), entity.begin(), entity.end());
  };
  add(curves_, curve_elements_, false, [&](std::size_t c, std::span<const EntityElement> one, const auto& nodes) {
    return curve_distances(*association_.geometry.curves[c].shape, one, order_, nodes, coordinates, team_);
  });
  add(surfaces_, surface_elements_, true, [&](std::size_t s, std::span<const EntityElement> one, const auto& nodes) {
    return surface_distances(*association_.geometry.surfaces[s].shape, one, order_, nodes, coordinates, team_);
  });
  return all;
}

}  // namespace varimesh::detail
