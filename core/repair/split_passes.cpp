#include "core/repair/split_passes.h"

#include <algorithm>
#include <span>
#include <utility>

#include "core/base/index.h"
#include "core/base/team.h"
#include "core/mesh/connectivity.h"
#include "core/problem/fixed_nodes.h"
#include "core/repair/choose_splits.h"
#include "core/repair/split.h"
#include "core/validity/certifier.h"

namespace varimesh {
namespace {

/// The margin up to which a group is weak (docs/repair.md has what other values do).
constexpr double kWeakMargin = 0.08;
constexpr int kMostPasses = 8;

/// The splits of one pass, and how many groups it has found. Inside team.run().
std::vector<SplitPlace> splits_of_pass(const HighOrderMesh& mesh, const std::vector<bool>& fixed,
                                       const std::vector<std::int64_t>& wanted, std::vector<CellCorner> marked,
                                       const SplitRules& rules, const Cells& cells, const Team& team,
                                       std::size_t& found) {
  std::vector<Certificate> certificates(cells.count());
  Certifier(mesh).certify(mesh.coordinates, certificates, team);
  WeakRule rule{kWeakMargin, std::vector<bool>(cells.count(), false), std::move(marked)};
  for (std::size_t c = 0; c < cells.count(); ++c)
    rule.wanted[c] = !certificates[c].is_valid() && std::ranges::binary_search(wanted, cells.number(c));
  std::ranges::sort(rule.marked);
  const std::vector<WeakGroup> groups = weak_groups(mesh, fixed, rules, rule, team);
  found = groups.size();
  return choose_splits(groups, rules);
}

/// Adds the new parts of wanted elements.
void add_parts(std::span<const RepairStep> steps, std::vector<std::int64_t>& wanted) {
  std::vector<std::int64_t> parts;
  for (const RepairStep& step : steps) {
    const std::size_t per_element = step.new_elements.size() / step.elements.size();
    for (std::size_t e = 0; e < step.elements.size(); ++e)
      if (std::ranges::binary_search(wanted, step.elements[e]))
        for (std::size_t k = 0; k < per_element; ++k) parts.push_back(step.new_elements[e * per_element + k]);
  }
  wanted.insert(wanted.end(), parts.begin(), parts.end());
  std::ranges::sort(wanted);
}

/// One pass over the mesh. False if it found nothing to split.
bool split_once(HighOrderMesh& mesh, const Options& options, std::vector<std::int64_t>& wanted,
                std::vector<CellCorner> marked, const Team& team, std::vector<RepairStep>& steps,
                const OnLook& on_look) {
  team.look();
  const Expected<std::vector<bool>> fixed = choose_fixed_nodes(mesh, options);
  if (!fixed) return false;
  team.look();
  const Cells cells(mesh, mesh.dimension);
  const SplitRules rules(mesh, cells, *fixed);
  std::vector<SplitPlace> places;
  std::size_t found = 0;
  team.run([&] { places = splits_of_pass(mesh, *fixed, wanted, std::move(marked), rules, cells, team, found); });
  team.look();
  if (on_look) on_look(found);
  if (places.empty()) return false;
  const std::size_t had = steps.size();
  mesh = split(mesh, places, steps);
  add_parts({steps.begin() + static_cast<std::ptrdiff_t>(had), steps.end()}, wanted);
  return true;
}

}  // namespace

HighOrderMesh split_in_passes(HighOrderMesh mesh, const Options& options, std::vector<std::int64_t> wanted,
                              std::vector<CellCorner> marked, std::vector<RepairStep>& steps, const StopToken& stop,
                              const OnLook& on_look) {
  if (mesh.dimension != 3) return mesh;
  Team team(options.threads);
  team.set_stop(&stop);
  try {
    for (int pass = 0; pass < kMostPasses; ++pass)
      if (!split_once(mesh, options, wanted, std::exchange(marked, {}), team, steps, on_look)) break;
  } catch (const Interrupted&) {  // the mesh is as the last whole pass has left it
  }
  return mesh;
}

}  // namespace varimesh
