#include "core/optimise/sequences/swap_left.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/team.h"
#include "core/merit/merit.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/grace.h"
#include "core/optimise/set_up.h"
#include "core/problem/fixed_nodes.h"
#include "core/repair/swaps/swap_passes.h"
#include "core/validity/certifier.h"

namespace varimesh {
namespace {

/// Sorts the elements that no movement makes valid into those for which changes are tried, and the others.
void sort_unrepairable(const Result& result, SwapTask& task) {
  for (const UnrepairableGroup& group : result.unrepairable) {
    std::vector<std::int64_t>* to = group.kind == UnrepairableGroup::Kind::FoldedFace ? &task.hopeless
                                    : is_proved(group)                                ? &task.stuck
                                                                                      : nullptr;
    if (to != nullptr && (to == &task.hopeless || group.elements.size() == 1))
      to->insert(to->end(), group.elements.begin(), group.elements.end());
  }
  std::ranges::sort(task.hopeless);
  std::ranges::sort(task.stuck);
}

/// Keeps the groups whose elements all exist, and finds their cells.
void keep_groups(Result& result) {
  const Cells cells(result.mesh, result.mesh.dimension);
  std::vector<std::pair<std::int64_t, std::int32_t>> places;
  for (std::size_t c = 0; c < cells.count(); ++c) places.emplace_back(cells.number(c), static_cast<std::int32_t>(c));
  std::ranges::sort(places);
  std::erase_if(result.unrepairable, [&](UnrepairableGroup& group) {
    group.cells.clear();
    for (const std::int64_t number : group.elements) {
      const auto found = std::ranges::lower_bound(places, number, {}, &std::pair<std::int64_t, std::int32_t>::first);
      if (found == places.end() || found->first != number) return true;
      group.cells.push_back(found->second);
    }
    return false;
  });
}

}  // namespace

bool swap_left(Result& result, const Options& options, StopToken& stop,
               const std::function<void(std::int64_t wanted)>& on_pass) {
  SwapTask task{options, 0, {}, {}, on_pass};
  if (const Asked asked = asked_by(options); asked.what == Asked::What::Loss) task.aim = asked.bound;
  sort_unrepairable(result, task);
  std::vector<RepairStep> steps;
  HighOrderMesh mesh = swap_in_passes(result.mesh, task, steps, stop);
  const Expected<std::vector<bool>> fixed = choose_fixed_nodes(mesh, options);
  if (steps.empty() || !fixed) return false;
  result.mesh = std::move(mesh);
  result.repairs.insert(result.repairs.end(), steps.begin(), steps.end());
  result.sizes = mesh_summary(result.mesh, *fixed);
  Team team(options.threads);
  const Certifier certifier(result.mesh);
  std::vector<Certificate> certificates(certifier.cells());
  Grace grace(team, stop, certifier.cells());
  team.run([&] { certifier.certify(result.mesh.coordinates, certificates, team); });  // without the token
  grace.watch();
  result.after = report_quality(result.mesh, certifier, certificates, team, grace);
  keep_groups(result);
  return true;
}

}  // namespace varimesh
