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

/// The splits of one pass; none if it was asked to stop. Inside team.run().
std::vector<SplitPlace> splits_of_pass(const HighOrderMesh& mesh, const std::vector<bool>& fixed,
                                       std::vector<CellCorner> marked, const std::function<bool()>& stop_asked,
                                       const SplitRules& rules, const Cells& cells, const Team& team) {
  std::vector<Certificate> certificates(cells.count());
  Certifier(mesh).certify(mesh.coordinates, certificates, team);
  if (stop_asked()) return {};
  const std::vector<bool> folded = folded_cells(mesh, fixed, cells.count(), team);
  WeakRule rule{kWeakMargin, std::vector<bool>(cells.count(), false), std::move(marked)};
  for (std::size_t c = 0; c < cells.count(); ++c) rule.wanted[c] = !folded[c] && !certificates[c].is_valid();
  std::ranges::sort(rule.marked);
  if (stop_asked()) return {};
  return choose_splits(weak_groups(mesh, fixed, rules, rule, team), rules);
}

}  // namespace

HighOrderMesh split_in_passes(HighOrderMesh mesh, const Options& options, std::vector<CellCorner> marked,
                              std::vector<RepairStep>& steps, const std::function<bool()>& stop_asked) {
  if (mesh.dimension != 3) return mesh;
  const Team team(options.threads);
  for (int pass = 0; pass < kMostPasses && !stop_asked(); ++pass) {
    const Expected<std::vector<bool>> fixed = choose_fixed_nodes(mesh, options);
    if (!fixed) break;
    const Cells cells(mesh, mesh.dimension);
    const SplitRules rules(mesh, cells, *fixed);
    std::vector<SplitPlace> places;
    team.run([&] { places = splits_of_pass(mesh, *fixed, std::move(marked), stop_asked, rules, cells, team); });
    if (places.empty() || stop_asked()) break;
    marked.clear();
    mesh = split(mesh, places, steps);
  }
  return mesh;
}

}  // namespace varimesh
