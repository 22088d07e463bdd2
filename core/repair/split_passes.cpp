#include "core/repair/split_passes.h"

#include <algorithm>
#include <utility>

#include "core/base/index.h"
#include "core/base/team.h"
#include "core/diagnosis/diagnose.h"
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

/// By cell: whether it has a folded boundary face.
std::vector<bool> folded_cells(const HighOrderMesh& mesh, const std::vector<bool>& fixed, std::size_t cells,
                               const Team& team) {
  std::vector<bool> folded(cells, false);
  for (const UnrepairableGroup& group : diagnose(mesh, fixed, team))
    if (group.kind == UnrepairableGroup::Kind::FoldedFace)
      for (const std::int32_t cell : group.cells) folded[at(cell)] = true;
  return folded;
}

/// The splits of one pass. Inside team.run().
std::vector<SplitPlace> splits_of_pass(const HighOrderMesh& mesh, const std::vector<bool>& fixed,
                                       std::vector<CellCorner> marked, const SplitRules& rules, const Cells& cells,
                                       const Team& team) {
  std::vector<Certificate> certificates(cells.count());
  Certifier(mesh).certify(mesh.coordinates, certificates, team);
  const std::vector<bool> folded = folded_cells(mesh, fixed, cells.count(), team);
  WeakRule rule{kWeakMargin, std::vector<bool>(cells.count(), false), std::move(marked)};
  for (std::size_t c = 0; c < cells.count(); ++c) rule.wanted[c] = !folded[c] && !certificates[c].is_valid();
  std::ranges::sort(rule.marked);
  return choose_splits(weak_groups(mesh, fixed, rules, rule, team), rules);
}

/// One pass over the mesh. False if it found nothing to split.
bool split_once(HighOrderMesh& mesh, const Options& options, std::vector<CellCorner> marked, const Team& team,
                std::vector<RepairStep>& steps) {
  team.look();
  const Expected<std::vector<bool>> fixed = choose_fixed_nodes(mesh, options);
  if (!fixed) return false;
  team.look();
  const Cells cells(mesh, mesh.dimension);
  const SplitRules rules(mesh, cells, *fixed);
  std::vector<SplitPlace> places;
  team.run([&] { places = splits_of_pass(mesh, *fixed, std::move(marked), rules, cells, team); });
  team.look();
  if (places.empty()) return false;
  mesh = split(mesh, places, steps);
  return true;
}

}  // namespace

HighOrderMesh split_in_passes(HighOrderMesh mesh, const Options& options, std::vector<CellCorner> marked,
                              std::vector<RepairStep>& steps, const StopToken& stop) {
  if (mesh.dimension != 3) return mesh;
  Team team(options.threads);
  team.set_stop(&stop);
  try {
    for (int pass = 0; pass < kMostPasses; ++pass)
      if (!split_once(mesh, options, std::exchange(marked, {}), team, steps)) break;
  } catch (const Interrupted&) {  // the mesh is as the last whole pass has left it
  }
  return mesh;
}

}  // namespace varimesh
