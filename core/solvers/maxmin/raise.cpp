#include "core/solvers/maxmin/raise.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "core/base/index.h"
#include "core/merit/merit.h"
#include "core/merit/thresholds.h"
#include "core/mesh/connectivity.h"
#include "core/problem/cells_at_vertices.h"
#include "core/reference/shape.h"
#include "core/solvers/maxmin/patch.h"

namespace varimesh {
namespace {

/// What a cell needs at the samples so that its certificate is likely.
constexpr double kEnoughForValid = threshold::kWeak;
/// Looks at cells: per cell of the mesh, and at least. A patch takes some hundreds.
constexpr std::int64_t kLooksPerCell = 50, kLeastLooks = 50'000;
/// If cells are valid and only to be raised, a look at a cell whose table has more numbers per direction than this
/// counts as several looks. A quartic hexahedron has seven times as many.
constexpr std::int64_t kNumbersPerLook = 25'000;
/// A cell this near to the smallest level of its patch has reached its limit.
constexpr double kAtLimit = 1e-3;
/// Of cells around a low one. On a mesh with 44 cells below .1, one layer leaves 7 of them, and two leave none.
constexpr int kMostLayers = 2;
/// A cell whose scaled Jacobian is within this of what it was has not changed but by rounding.
constexpr double kAsBefore = 1e-9;
/// Cells that a thread samples at a time.
constexpr std::int32_t kGrain = 16;

/// If J is negative between the samples of a cell, their spacing is halved, and the patch is raised again, at most so
/// often. Two cells of docs/untangling.md need three rounds.
constexpr int kMostRounds = 4;

class Raiser {
 public:
  Raiser(const RaiseTask& task, std::vector<double>& coordinates, std::vector<Certificate>& certificates,
         const Team& team, RaiseMemory& memory, std::int64_t most_looks)
      : mesh_(task.mesh),
        coordinates_(coordinates),
        fixed_(task.fixed),
        hopeless_(task.hopeless),
        certifier_(task.certifier),
        certificates_(certificates),
        aim_(task.aim),
        team_(team),
        cells_(task.mesh, task.mesh.dimension),
        tables_(task.mesh.order, task.mesh.dimension),
        memory_(memory),
        left_(std::max(kLeastLooks, kLooksPerCell * static_cast<std::int64_t>(cells_.count())) - memory.looks),
        most_looks_(most_looks) {
    memory_.tried.resize(cells_.count(), 0);
    memory_.level.resize(cells_.count(), 0);
    memory_.shift.resize(cells_.count(), 0);
  }

  RaiseOutcome raise() {
    RaiseOutcome outcome;
    std::vector<std::int32_t> low;
    std::vector<char> was_valid;
    try {
      low = low_cells();
      if (low.empty()) return outcome;
      for (const std::int32_t cell : low) was_valid.push_back(certificates_[at(cell)].is_valid() ? 1 : 0);
      find_neighbours();
      const std::int64_t first = memory_.looks;
      for (const std::int32_t cell : low) {
        outcome.finished = memory_.looks - first < most_looks_ || most_looks_ == 0;
        if (!outcome.finished) break;
        raise_around(cell);
        memory_.tried[at(cell)] = 1;
        memory_.level[at(cell)] = sampled(cell);
      }
      outcome.patches = patches_;
    } catch (const Interrupted&) {
      outcome.interrupted = true;
    }
    for (std::size_t k = 0; k < was_valid.size(); ++k) {
      const bool is_valid = certificates_[at(low[k])].is_valid();
      if (is_valid && was_valid[k] == 0)
        outcome.made_valid.push_back(cells_.number(at(low[k])));
      else if (is_valid && raised_.contains(low[k]))
        outcome.raised.push_back(cells_.number(at(low[k])));
    }
    std::ranges::sort(outcome.made_valid);
    std::ranges::sort(outcome.raised);
    return outcome;
  }

  void forget_changed() {
    memory_.looks = 0;
    for (std::int32_t cell = 0; at(cell) < cells_.count(); ++cell)
      if (memory_.tried[at(cell)] != 0)
        memory_.tried[at(cell)] =
            !certificates_[at(cell)].is_valid() && std::abs(sampled(cell) - memory_.level[at(cell)]) <= kAsBefore ? 1
                                                                                                                  : 0;
  }

 private:
  // ===== which cells =====

  MaxMinPatch::Cell patch_cell(std::int32_t cell) {
    MaxMinPatch::Cell result;
    result.number = cell;
    result.shape = cells_.shape(at(cell));
    result.nodes = cells_.nodes(at(cell));
    result.samples = tables_.table(result.shape);
    result.shift = memory_.shift[at(cell)];
    return result;
  }

  /// The scaled Jacobian at the samples.
  double sampled(std::int32_t cell) {
    MaxMinPatch::Cell one = patch_cell(cell);
    if (one.samples == nullptr) return 1;
    MaxMinPatch patch({one}, {one.nodes.begin(), one.nodes.begin() + 1}, mesh_.dimension, coordinates_);
    return patch.look_at_cells(coordinates_, team_).scaled_jacobian.front();
  }

  std::vector<std::int32_t> low_cells() {
    std::vector<std::pair<double, std::int32_t>> found;
    for (std::int32_t cell = 0; at(cell) < cells_.count(); ++cell)
      if (may_be_low(cell)) found.emplace_back(0, cell);
    if (found.empty()) return {};
    for (const Cells::Range& range : cells_.ranges()) tables_.table(range.block->shape);
    team_.for_each(static_cast<std::int32_t>(found.size()), kGrain,
                   [&](std::int32_t k) { found[at(k)].first = sampled(found[at(k)].second); });
    std::erase_if(found,
                  [&](const auto& each) { return certificates_[at(each.second)].is_valid() && each.first >= aim_; });
    std::ranges::sort(found);
    std::vector<std::int32_t> result;
    for (const auto& [js, cell] : found) result.push_back(cell);
    return result;
  }

  bool may_be_low(std::int32_t cell) const {
    if (memory_.tried[at(cell)] != 0) return false;
    const Certificate& certificate = certificates_[at(cell)];
    if (certificate.is_valid()) return aim_ > 0 && certificate.scaled_jacobian_lower_bound < aim_;
    return !is_hopeless(cell);
  }

  bool is_hopeless(std::int32_t cell) const { return hopeless_[at(cell)] != 0 && !certificates_[at(cell)].is_valid(); }

  // ===== patches =====

  class Before;

  /// The cells of each vertex, and in how many cells each node is.
  void find_neighbours() {
    in_cells_.assign(mesh_.node_count(), 0);
    for (std::size_t cell = 0; cell < cells_.count(); ++cell)
      for (const std::int32_t node : cells_.nodes(cell)) ++in_cells_[at(node)];
    at_vertices_ = detail::CellsAtVertices(cells_, mesh_.node_count());
  }

  /// The nodes that only these cells have, and that are not fixed.
  std::vector<std::int32_t> free_nodes(const std::vector<std::int32_t>& cells) const {
    std::vector<std::int32_t> nodes, result;
    for (const std::int32_t cell : cells)
      nodes.insert(nodes.end(), cells_.nodes(at(cell)).begin(), cells_.nodes(at(cell)).end());
    std::ranges::sort(nodes);
    for (auto node = nodes.begin(); node != nodes.end();) {
      const auto end = std::upper_bound(node, nodes.end(), *node);
      if (!fixed_[at(*node)] && end - node == in_cells_[at(*node)]) result.push_back(*node);
      node = end;
    }
    return result;
  }

  void raise_around(std::int32_t cell) {
    for (int layers = 1; layers <= kMostLayers && left_ > 0; ++layers) {
      const bool is_valid = certificates_[at(cell)].is_valid();
      if (is_valid && sampled(cell) >= aim_) return;
      if (!raise_patch(cell, layers)) return;
    }
  }

  /// The cells of a patch; none if a table would be too large.
  std::vector<MaxMinPatch::Cell> patch_cells(const std::vector<std::int32_t>& around) {
    std::vector<MaxMinPatch::Cell> taken;
    for (const std::int32_t each : around) {
      if (is_hopeless(each)) continue;
      taken.push_back(patch_cell(each));
      if (taken.back().samples == nullptr) return {};
    }
    return taken;
  }

  /// Returns false if the cell cannot be raised in a larger patch either.
  bool raise_patch(std::int32_t cell, int layers) {
    team_.look_together();
    const std::vector<std::int32_t> around = at_vertices_.around(cells_, cell, layers);
    const std::vector<std::int32_t> free = free_nodes(around);
    std::vector<MaxMinPatch::Cell> taken = patch_cells(around);
    if (taken.empty()) return false;
    if (free.empty()) return true;
    MaxMinPatch patch(taken, free, mesh_.dimension, coordinates_);
    const Before before(*this, around, free);
    try {
      const MaxMinPatch::Levels old = patch.look_at_cells(coordinates_, team_);
      MaxMinPatch::Levels now = raise(patch, around);
      if (now.smallest > 0 && raise_between_samples(cell, std::move(taken), around, free, before))
        now = patch.look_at_cells(coordinates_, team_);
      if (!is_better(before.merit_now(now.smallest), before.merit(old.smallest), kAskForMinimum))
        before.restore();
      else
        note_raised(patch, old, now);
      if (layers == kMostLayers) note_limits(cell, patch, now);
    } catch (const Interrupted&) {
      before.restore();
      throw;
    }
    return true;
  }

  /// What looks at cells of a patch count.
  std::int64_t cost_of(std::int64_t looks, const MaxMinPatch& patch) const {
    if (aim_ == 0) return looks;
    std::int64_t numbers = 0;
    for (const MaxMinPatch::Cell& cell : patch.cells())
      numbers += static_cast<std::int64_t>(cell.samples->points() * cell.samples->nodes());
    const std::int64_t most = kNumbersPerLook * static_cast<std::int64_t>(patch.cells().size());
    return numbers > most ? looks * numbers / most : looks;
  }

  /// Raises the patch, and certifies its cells.
  MaxMinPatch::Levels raise(MaxMinPatch& patch, const std::vector<std::int32_t>& around) {
    MaxMinPatch::Levels now = patch.raise(coordinates_, std::max(aim_, kEnoughForValid), team_);
    left_ -= cost_of(now.looks, patch);
    memory_.looks += cost_of(now.looks, patch);
    ++patches_;
    certifier_.certify(coordinates_, around, certificates_, team_);
    return now;
  }

  /// While all cells are positive at the samples, but J is negative between the samples of some, takes closer samples
  /// of these and raises the patch again. Returns whether it has moved.
  bool raise_between_samples(std::int32_t middle, std::vector<MaxMinPatch::Cell> cells,
                             const std::vector<std::int32_t>& around, const std::vector<std::int32_t>& free,
                             const Before& before) {
    std::map<std::int32_t, int> halvings;
    for (int round = 0; round < kMostRounds && left_ > 0; ++round) {
      const std::vector<std::int32_t> doubtful = before.not_kept(middle);
      bool is_closer = false;
      for (MaxMinPatch::Cell& each : cells) {
        if (!std::ranges::binary_search(doubtful, each.number) || halvings[each.number] == SampleTables::kMostHalvings)
          continue;
        const SampleTable* const closer = tables_.table(each.shape, ++halvings[each.number]);
        if (closer == nullptr) return round > 0;
        each.samples = closer;
        each.shift = 0;
        is_closer = true;
      }
      if (!is_closer) return round > 0;
      MaxMinPatch patch(cells, free, mesh_.dimension, coordinates_);
      if (raise(patch, around).smallest <= 0) return true;
    }
    return true;
  }

  /// The coordinates and certificates of a patch before it is raised.
  class Before {
   public:
    Before(Raiser& raiser, const std::vector<std::int32_t>& cells, const std::vector<std::int32_t>& nodes)
        : raiser_(raiser), cells_(cells), nodes_(nodes), coordinates_(3 * nodes.size()) {
      for (std::size_t n = 0; n < nodes.size(); ++n)
        std::copy_n(raiser.coordinates_.data() + 3 * at(nodes[n]), 3, coordinates_.data() + 3 * n);
      for (const std::int32_t cell : cells) certificates_.push_back(raiser.certificates_[at(cell)]);
    }

    void restore() const {
      for (std::size_t n = 0; n < nodes_.size(); ++n)
        std::copy_n(coordinates_.data() + 3 * n, 3, raiser_.coordinates_.data() + 3 * at(nodes_[n]));
      for (std::size_t c = 0; c < cells_.size(); ++c) raiser_.certificates_[at(cells_[c])] = certificates_[c];
    }

    /// Those of this cell and the cells that were certified that are not certified now, ascending.
    std::vector<std::int32_t> not_kept(std::int32_t cell) const {
      std::vector<std::int32_t> result;
      for (std::size_t c = 0; c < cells_.size(); ++c)
        if ((certificates_[c].is_valid() || cells_[c] == cell) && !raiser_.certificates_[at(cells_[c])].is_valid())
          result.push_back(cells_[c]);
      return result;
    }

    /// Of the patch before it was raised, and now, if its smallest scaled Jacobian at the samples is this one.
    Merit merit(double smallest) const {
      Merit merit{.smallest = smallest};
      for (const Certificate& certificate : certificates_) merit.uncertified += certificate.is_valid() ? 0 : 1;
      return merit;
    }
    Merit merit_now(double smallest) const {
      Merit merit{.smallest = smallest};
      for (std::size_t c = 0; c < cells_.size(); ++c) {
        if (raiser_.certificates_[at(cells_[c])].is_valid()) continue;
        ++merit.uncertified;
        merit.lost += certificates_[c].is_valid() ? 1 : 0;
      }
      return merit;
    }

   private:
    Raiser& raiser_;
    const std::vector<std::int32_t>&cells_, &nodes_;
    std::vector<double> coordinates_;
    std::vector<Certificate> certificates_;
  };

  void note_raised(const MaxMinPatch& patch, const MaxMinPatch::Levels& old, const MaxMinPatch::Levels& now) {
    for (std::size_t c = 0; c < patch.cells().size(); ++c)
      if (now.scaled_jacobian[c] > old.scaled_jacobian[c]) raised_.insert(patch.cells()[c].number);
  }

  /// Cells that have reached their limit below the aim do not hold others from now on.
  void note_limits(std::int32_t cell, const MaxMinPatch& patch, const MaxMinPatch::Levels& now) {
    const double enough = std::max(aim_, kEnoughForValid);
    for (std::size_t c = 0; c < patch.cells().size(); ++c) {
      const MaxMinPatch::Cell& each = patch.cells()[c];
      const bool at_limit = each.number == cell || now.level[c] + each.shift < now.smallest + kAtLimit;
      if (at_limit && now.scaled_jacobian[c] < enough) memory_.shift[at(each.number)] = 2 * enough - now.level[c];
    }
  }

  const HighOrderMesh& mesh_;
  std::vector<double>& coordinates_;
  const std::vector<bool>& fixed_;
  std::span<const char> hopeless_;
  const Certifier& certifier_;
  std::vector<Certificate>& certificates_;
  double aim_;
  const Team& team_;
  Cells cells_;
  SampleTables tables_;
  std::vector<std::int32_t> in_cells_;  // by node
  detail::CellsAtVertices at_vertices_;
  std::set<std::int32_t> raised_;
  RaiseMemory& memory_;
  std::int64_t left_;  // looks
  std::int64_t most_looks_, patches_ = 0;
};

}  // namespace

RaiseOutcome raise_low_cells(const RaiseTask& task, std::vector<double>& coordinates,
                             std::vector<Certificate>& certificates, const Team& team, RaiseMemory* memory,
                             std::int64_t most_looks) {
  RaiseMemory own;
  return Raiser(task, coordinates, certificates, team, memory == nullptr ? own : *memory, most_looks).raise();
}

void forget_changed_cells(const RaiseTask& task, std::vector<double>& coordinates,
                          std::vector<Certificate>& certificates, const Team& team, RaiseMemory& memory) {
  Raiser(task, coordinates, certificates, team, memory, 0).forget_changed();
}

}  // namespace varimesh
