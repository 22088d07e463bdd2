#include "core/repair/swaps/swap_passes.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "core/base/index.h"
#include "core/base/team.h"
#include "core/merit/merit.h"
#include "core/merit/thresholds.h"
#include "core/mesh/plane.h"
#include "core/problem/fixed_nodes.h"
#include "core/repair/swaps/cell_patch.h"
#include "core/repair/swaps/changes_around.h"
#include "core/solvers/maxmin/raise.h"
#include "core/validity/certifier.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

constexpr int kMostPasses = 8;
/// Layers of cells around a wanted cell. Inner ones move, and the outermost only sees that nothing is lost.
constexpr int kLayers = 2;
/// Of the changes around a cell, how many are tried; and how often in a row.
constexpr std::size_t kMostTried = 10;
constexpr int kMostInARow = 4;
/// Looks at cells: while one copy of a patch is raised (no new cell is begun after as many); in all, per cell of the
/// mesh; and in all, at least.
constexpr std::int64_t kMostLooks = 3000, kLooksPerCell = 150, kLeastLooks = 150'000;

/// How closely scaled Jacobians are known that decide: within what counts as higher.
constexpr CertificateOptions kSharp{.gap = threshold::kHigher};

bool is_among(const std::vector<std::int64_t>& numbers, std::int64_t number) {
  return std::ranges::binary_search(numbers, number);
}

/// A patch with what is proved about its cells.
struct Seen {
  CellPatch patch;
  std::vector<Certificate> certificates;
  Merit merit;
  std::int64_t looks = 0;  ///< At cells, while it was raised.
};

/// Changes one patch for one cell.
class PatchSwapper {
 public:
  /// `looks` is what all patches have looked at so far.
  PatchSwapper(const SwapTask& task, double orientation, const StopToken& stop, std::int64_t& looks)
      : task_(task), orientation_(orientation), stop_(stop), looks_(looks) {}

  /// The patch after all changes that help; nothing if none does. `number` is the wanted cell.
  std::optional<CellPatch> swap(CellPatch patch, std::int64_t number, const Team& team) {
    std::optional<Seen> best = look(std::move(patch), false);
    if (!best || !is_lowest(*best, number)) return std::nullopt;
    std::vector<std::int64_t> wanted{number};
    for (int k = 0; k < kMostInARow && !wanted.empty(); ++k) {
      std::optional<Seen> better = best_of_changes(*best, wanted.front(), team);
      if (!better) break;
      best = std::move(better);
      wanted = low_successors(*best);
    }
    if (best->patch.done.empty()) return std::nullopt;
    return std::move(best->patch);
  }

 private:
  /// Whether the cell is not certified, or decides over the smallest scaled Jacobian. If it does not, no change of it
  /// would count.
  bool is_lowest(const Seen& seen, std::int64_t number) const {
    const Cells cells(seen.patch.mesh, seen.patch.mesh.dimension);
    double own = 1, smallest = 1;
    for (std::size_t c = 0; c < cells.count(); ++c) {
      const Certificate& certificate = seen.certificates[c];
      const double level = certificate.is_valid() ? certificate.scaled_jacobian_lower_bound : -1;
      if (cells.number(c) == number) own = level;
      if (!is_among(task_.hopeless, cells.number(c)) && !is_among(task_.stuck, cells.number(c)))
        smallest = std::min(smallest, level);
    }
    return own <= smallest;
  }

  std::optional<Seen> best_of_changes(const Seen& now, std::int64_t number, const Team& team) {
    const Cells cells(now.patch.mesh, now.patch.mesh.dimension);
    std::int32_t cell = 0;
    while (cells.number(at(cell)) != number) ++cell;
    std::vector<CellChange> changes = changes_around(now.patch, cell);
    if (changes.size() > kMostTried) changes.resize(kMostTried);
    std::vector<std::optional<Seen>> tried(changes.size());
    team.run([&] {
      team.for_each(static_cast<std::int32_t>(changes.size()), 1,
                    [&](std::int32_t k) { tried[at(k)] = look(changed(now.patch, changes[at(k)]), true, &now); });
    });
    std::optional<Seen> best;
    for (std::optional<Seen>& each : tried) {
      if (each) looks_ += each->looks;
      if (each && helps(each->merit, best ? best->merit : now.merit)) best = std::move(each);
    }
    return best;
  }

  static bool helps(const Merit& now, const Merit& before) {
    if (is_better(now, before)) return true;
    return !is_better(before, now) && has_higher_minimum(now, before);
  }

  /// Raises the patch, if it is to be raised, and judges it. Nothing if its cells are mostly inside out.
  std::optional<Seen> look(CellPatch patch, bool raises, const Seen* before = nullptr) const {
    if (detail::orientation(patch.mesh) != orientation_) return std::nullopt;
    Seen seen{std::move(patch), {}, {}, 0};
    HighOrderMesh& mesh = seen.patch.mesh;
    const Cells cells(mesh, mesh.dimension);
    seen.certificates.resize(cells.count());
    std::vector<char> stays_low(cells.count(), 0);
    for (std::size_t c = 0; c < cells.count(); ++c)
      stays_low[c] = is_among(task_.hopeless, cells.number(c)) || is_among(task_.stuck, cells.number(c)) ? 1 : 0;
    Team one(1);
    one.set_stop(&stop_);
    one.run([&] {
      if (raises) {
        const Certifier certifier(mesh);
        certifier.certify(mesh.coordinates, seen.certificates, one);
        const RaiseTask task{mesh, seen.patch.fixed, stays_low, certifier, task_.aim};
        RaiseMemory memory;
        raise_low_cells(task, mesh.coordinates, seen.certificates, one, &memory, kMostLooks);
        seen.looks = memory.looks;
      }
      Certifier(mesh, kSharp).certify(mesh.coordinates, seen.certificates, one);
    });
    judge(seen, cells, stays_low, before);
    return seen;
  }

  /// The smallest scaled Jacobian counts only if all cells that can be are certified, and up to the aim.
  void judge(Seen& seen, const Cells& cells, const std::vector<char>& stays_low, const Seen* before) const {
    double smallest = std::numeric_limits<double>::infinity();
    bool is_whole = true;
    for (std::size_t c = 0; c < cells.count(); ++c) {
      if (!seen.certificates[c].is_valid()) {
        ++seen.merit.uncertified;
        is_whole = is_whole && stays_low[c] != 0;
        if (before != nullptr && was_valid(*before, cells.number(c))) ++seen.merit.lost;
      } else {
        smallest = std::min(smallest, seen.certificates[c].scaled_jacobian_lower_bound);
      }
    }
    if (is_whole) seen.merit.smallest = std::min(smallest, task_.aim);
  }

  static bool was_valid(const Seen& before, std::int64_t number) {
    const Cells cells(before.patch.mesh, before.patch.mesh.dimension);
    for (std::size_t c = 0; c < cells.count(); ++c)
      if (cells.number(c) == number) return before.certificates[c].is_valid();
    return false;  // it is new
  }

  /// New cells that are still wanted, the lowest first.
  std::vector<std::int64_t> low_successors(const Seen& seen) const {
    std::vector<std::pair<double, std::int64_t>> low;
    const Cells cells(seen.patch.mesh, seen.patch.mesh.dimension);
    for (std::size_t c = 0; c < cells.count(); ++c) {
      const Certificate& certificate = seen.certificates[c];
      if (cells.number(c) > 0 || (certificate.is_valid() && certificate.scaled_jacobian_lower_bound >= task_.aim))
        continue;
      low.emplace_back(certificate.scaled_jacobian_lower_bound, cells.number(c));
    }
    std::ranges::sort(low);
    std::vector<std::int64_t> result;
    for (const auto& [level, number] : low) result.push_back(number);
    return result;
  }

  const SwapTask& task_;
  double orientation_;
  const StopToken& stop_;
  std::int64_t& looks_;
};

/// One pass over the mesh.
class Pass {
 public:
  /// `in_vain`: numbers of the cells that were tried since something near them changed.
  Pass(const HighOrderMesh& mesh, const SwapTask& task, const Team& team, const StopToken& stop,
       std::set<std::int64_t>& in_vain, std::int64_t& looks)
      : mesh_(mesh),
        task_(task),
        team_(team),
        stop_(stop),
        in_vain_(in_vain),
        looks_(looks),
        cells_(mesh, mesh.dimension) {}

  /// The patches that have changed; they share no cell.
  std::vector<CellPatch> run() {
    const Expected<std::vector<bool>> fixed = choose_fixed_nodes(mesh_, task_.options);
    if (!fixed) return {};
    const std::vector<std::int32_t> wanted = wanted_cells();
    if (task_.on_pass) task_.on_pass(static_cast<std::int64_t>(wanted.size()));
    if (wanted.empty()) return {};
    const SplitRules rules(mesh_, cells_, *fixed);
    PatchSwapper swapper(task_, detail::orientation(mesh_), stop_, looks_);
    const std::int64_t most = std::max(kLeastLooks, kLooksPerCell * static_cast<std::int64_t>(cells_.count()));
    std::vector<CellPatch> result;
    std::vector<bool> locked(cells_.count(), false);
    try {
      for (const std::int32_t cell : wanted) {
        team_.look();
        if (looks_ >= most) break;
        const std::vector<std::int32_t> around = rules.at_vertices().around(cells_, cell, kLayers);
        if (std::ranges::any_of(around, [&](std::int32_t each) { return locked[at(each)]; })) continue;
        std::optional<CellPatch> patch =
            swapper.swap(take_patch(mesh_, cells_, around, *fixed, rules), cells_.number(at(cell)), team_);
        if (!patch) {
          in_vain_.insert(cells_.number(at(cell)));
          continue;
        }
        for (const std::int32_t each : around) {
          locked[at(each)] = true;
          in_vain_.erase(cells_.number(at(each)));
        }
        result.push_back(std::move(*patch));
      }
    } catch (const Interrupted&) {  // what was done stays
    }
    return result;
  }

 private:
  std::vector<std::int32_t> wanted_cells() const {
    std::vector<Certificate> certificates(cells_.count());
    team_.run([&] {
      Certifier(mesh_).certify(mesh_.coordinates, certificates, team_);
      std::vector<std::int32_t> doubtful;  // the bounds of the others are enough
      for (std::size_t c = 0; c < certificates.size(); ++c)
        if (certificates[c].is_valid() && certificates[c].scaled_jacobian_lower_bound < task_.aim)
          doubtful.push_back(static_cast<std::int32_t>(c));
      Certifier(mesh_, kSharp).certify(mesh_.coordinates, doubtful, certificates, team_);
    });
    std::vector<std::pair<double, std::int32_t>> wanted;
    for (std::size_t c = 0; c < cells_.count(); ++c) {
      const Shape shape = cells_.shape(c);
      if (shape != Shape::Triangle && shape != Shape::Tetrahedron) continue;
      const Certificate& certificate = certificates[c];
      if (certificate.is_valid() && certificate.scaled_jacobian_lower_bound >= task_.aim) continue;
      if (is_among(task_.hopeless, cells_.number(c)) || in_vain_.contains(cells_.number(c))) continue;
      wanted.emplace_back(certificate.scaled_jacobian_lower_bound, static_cast<std::int32_t>(c));
    }
    std::ranges::sort(wanted);
    std::vector<std::int32_t> result;
    for (const auto& [level, cell] : wanted) result.push_back(cell);
    return result;
  }

  const HighOrderMesh& mesh_;
  const SwapTask& task_;
  const Team& team_;
  const StopToken& stop_;
  std::set<std::int64_t>& in_vain_;
  std::int64_t& looks_;
  Cells cells_;
};

}  // namespace

HighOrderMesh swap_in_passes(HighOrderMesh mesh, const SwapTask& task, std::vector<RepairStep>& steps,
                             const StopToken& stop) {
  Team team(task.options.threads);
  team.set_stop(&stop);
  std::set<std::int64_t> in_vain;
  std::int64_t looks = 0;
  try {
    if (mesh.dimension == 2 && !lies_in_a_plane(mesh, team)) return mesh;
    for (int pass = 0; pass < kMostPasses; ++pass) {
      const std::vector<CellPatch> patches = Pass(mesh, task, team, stop, in_vain, looks).run();
      if (patches.empty()) break;
      put_back(mesh, patches, steps);
    }
  } catch (const Interrupted&) {  // the mesh is as the last pass has left it
  }
  return mesh;
}

}  // namespace varimesh
