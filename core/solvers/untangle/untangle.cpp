// Finds the patches, untangles them, and keeps the best state of each.
#include "core/solvers/untangle/untangle.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/index.h"

namespace varimesh {
namespace {

/// A patch ends after this many outer steps without fewer bad cells: before the first time that there are fewer, and
/// afterwards. The first steps may make more cells bad before they make fewer.
constexpr int kFirstPatience = 8, kPatience = 5;
/// It also ends after this many outer steps in which the smallest coefficient has hardly risen. On three meshes of CAD
/// parts this leaves as many elements as patience by itself. No other value was measured.
constexpr int kMostStanding = 3;
constexpr double kRise = 0.02;  // of the smallest coefficient
/// Patches that may leave a cell uncertified before it is given up. On the same three meshes a third one certified
/// none.
constexpr int kMostStarts = 2;
/// A cell that is longer than this times its shortest height is stretched. A regular tetrahedron has 1.2, a cube 1.7.
constexpr double kStretched = 5;
/// Patches whose cells' Hessians have more numbers than this, 2 GiB, are left out.
constexpr std::size_t kMostEntries = std::size_t{1} << 28;

/// Finds the active cells, the nodes that may move, and the patches that they form.
class PatchFinder {
 public:
  /// `stretched_layers`: around uncertified cells that are stretched.
  PatchFinder(const Problem& problem, std::span<const Standing> standings, int layers, int stretched_layers)
      : problem_(problem),
        active_(at(problem.cells), 0),
        rank_(problem.positions.size() / at(problem.dimension), -1),
        parent_(problem.free.size()) {
    for (std::size_t f = 0; f < problem.free.size(); ++f) rank_[at(problem.free[f])] = static_cast<std::int32_t>(f);
    const auto is_start = [&](std::size_t cell) {
      return standings[cell] == Standing::Lost || standings[cell] == Standing::Uncertified;
    };
    if (stretched_layers > layers) {
      for (const CellSet& set : problem.sets)
        for (std::int32_t cell = 0; cell < set.count; ++cell)
          active_[at(set.first + cell)] = is_start(at(set.first + cell)) && is_stretched(set, cell) ? 1 : 0;
      for (int layer = layers; layer < stretched_layers; ++layer) add_layer();
    }
    for (std::size_t cell = 0; cell < active_.size(); ++cell)
      if (is_start(cell)) active_[cell] = 1;
    for (int layer = 0; layer < layers; ++layer) add_layer();
    find_free();
    join();
  }

  /// The members and the nodes of one patch, in the order of the cells and of the nodes.
  struct Found {
    std::vector<UntanglePatch::Member> members;
    std::vector<std::int32_t> nodes;
  };
  std::vector<Found> patches(std::span<const Standing> standings) {
    std::vector<Found> result;
    std::vector<std::int32_t> patch_of(parent_.size(), -1), number(parent_.size(), -1);
    for (std::size_t f = 0; f < parent_.size(); ++f) {
      if (!free_[f]) continue;
      std::int32_t& patch = patch_of[at(root(static_cast<std::int32_t>(f)))];
      if (patch < 0) {
        patch = static_cast<std::int32_t>(result.size());
        result.emplace_back();
      }
      number[f] = static_cast<std::int32_t>(result[at(patch)].nodes.size());
      result[at(patch)].nodes.push_back(problem_.free[f]);
    }
    for (std::size_t b = 0; b < problem_.sets.size(); ++b)
      for (std::int32_t cell = 0; cell < problem_.sets[b].count; ++cell) {
        if (!active_[at(problem_.sets[b].first + cell)]) continue;
        UntanglePatch::Member member = make_member(static_cast<std::int16_t>(b), cell, standings);
        if (member.unknown.empty()) continue;
        const std::int32_t patch = patch_of[at(root(member.unknown.front()))];
        for (std::int32_t& unknown : member.unknown) unknown = number[at(unknown)];
        result[at(patch)].members.push_back(std::move(member));
      }
    return result;
  }

 private:
  template <class Visit>
  void for_active(Visit&& visit) const {
    for (const CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell)
        if (active_[at(set.first + cell)])
          visit(std::span(set.nodes).subspan(at(cell) * at(set.nodes_per_cell), at(set.nodes_per_cell)));
  }

  /// Whether the longest distance of two vertices is more than kStretched times the shortest height.
  bool is_stretched(const CellSet& set, std::int32_t cell) const {
    const auto d = at(problem_.dimension);
    const int vertices = reference::info(set.shape).vertices;
    double square = 0;
    for (int a = 0; a < vertices; ++a)
      for (int b = 0; b < a; ++b) {
        double distance = 0;
        for (std::size_t k = 0; k < d; ++k) {
          const auto place = [&](int v) {
            return problem_.positions[at(set.nodes[at(cell) * at(set.nodes_per_cell) + at(v)]) * d + k];
          };
          distance += (place(a) - place(b)) * (place(a) - place(b));
        }
        square = std::max(square, distance);
      }
    return std::sqrt(square) > kStretched * double(problem_.cell_size[at(set.first + cell)]);
  }

  /// Makes the cells active that share a vertex with an active one.
  void add_layer() {
    std::vector<char> touched(rank_.size(), 0);
    for (const CellSet& set : problem_.sets) {
      const int vertices = reference::info(set.shape).vertices;
      for (std::int32_t cell = 0; cell < set.count; ++cell)
        for (int v = 0; v < vertices && active_[at(set.first + cell)]; ++v)
          touched[at(set.nodes[at(cell) * at(set.nodes_per_cell) + at(v)])] = 1;
    }
    for (const CellSet& set : problem_.sets) {
      const int vertices = reference::info(set.shape).vertices;
      for (std::int32_t cell = 0; cell < set.count; ++cell)
        for (int v = 0; v < vertices; ++v)
          if (touched[at(set.nodes[at(cell) * at(set.nodes_per_cell) + at(v)])]) active_[at(set.first + cell)] = 1;
    }
  }

  void find_free() {
    free_.assign(problem_.free.size(), 1);
    for (std::size_t f = 0; f < free_.size(); ++f)
      for (std::int64_t i = problem_.offsets[f]; i < problem_.offsets[f + 1]; ++i) {
        const Incidence& incidence = problem_.incidences[at(i)];
        if (!active_[at(problem_.sets[at(incidence.set)].first + incidence.cell)]) free_[f] = 0;
      }
  }

  std::int32_t root(std::int32_t f) {
    while (parent_[at(f)] != f) f = parent_[at(f)] = parent_[at(parent_[at(f)])];
    return f;
  }

  /// Joins the free nodes of each active cell to one patch (union-find).
  void join() {
    std::iota(parent_.begin(), parent_.end(), 0);
    for_active([&](std::span<const std::int32_t> nodes) {
      std::int32_t first = -1;
      for (const std::int32_t node : nodes) {
        const std::int32_t f = rank_[at(node)];
        if (f < 0 || !free_[at(f)]) continue;
        if (first < 0) first = f;
        const std::int32_t a = root(first), b = root(f);
        parent_[at(std::max(a, b))] = std::min(a, b);
      }
    });
  }

  /// Its `unknown` are still ranks among the problem's free nodes.
  UntanglePatch::Member make_member(std::int16_t b, std::int32_t cell, std::span<const Standing> standings) const {
    const CellSet& set = problem_.sets[at(b)];
    const int d = problem_.dimension;
    UntanglePatch::Member member;
    member.set = b;
    member.cell.number = cell;
    member.cell.unrepairable = standings[at(set.first + cell)] == Standing::Unrepairable;
    member.cell.positions.resize(set.nodes_per_cell, d);
    for (int n = 0; n < set.nodes_per_cell; ++n) {
      const std::int32_t node = set.nodes[at(cell) * at(set.nodes_per_cell) + at(n)];
      for (int k = 0; k < d; ++k) member.cell.positions(n, k) = problem_.positions[at(node) * at(d) + at(k)];
      const std::int32_t f = rank_[at(node)];
      if (f < 0 || !free_[at(f)]) continue;
      member.cell.free.push_back(n);
      member.unknown.push_back(f);
    }
    return member;
  }

  const Problem& problem_;
  std::vector<char> active_;          // by cell
  std::vector<std::int32_t> rank_;    // by node: its rank in Problem::free; −1: fixed
  std::vector<std::int32_t> parent_;  // by rank: union-find of the nodes that are in one patch
  std::vector<char> free_;            // by rank: whether the node may move
};

bool fits_in_memory(const std::vector<UntanglePatch::Member>& members, int dimension) {
  std::size_t entries = 0;
  for (const UntanglePatch::Member& member : members) {
    const std::size_t unknowns = member.unknown.size() * at(dimension);
    entries += unknowns * unknowns;
  }
  return entries <= kMostEntries;
}

}  // namespace

Untangler::Untangler(ToBeRead, Problem& problem, const Kernels& kernels, Guard& guard, const Team& team,
                     FailedStarts& failed_starts, Depth depth, std::int64_t hessian_bytes, SpareMemory spare)
    : problem_(problem),
      kernels_(kernels),
      guard_(guard),
      team_(team),
      failed_starts_(failed_starts),
      depth_(depth),
      first_positions_(problem.positions),
      room_(hessian_bytes, std::move(spare)) {
  for (const CellSet& set : problem.sets) energies_.emplace_back(set);
}

Untangler::Untangler(FromHere, Problem& problem, const Kernels& kernels, Guard& guard, const Team& team,
                     FailedStarts& failed_starts, Depth depth, std::int64_t hessian_bytes, SpareMemory spare)
    : Untangler(ToBeRead{}, problem, kernels, guard, team, failed_starts, depth, hessian_bytes, std::move(spare)) {
  first_repairable_ = guard.repairable();
  begin();
}

Untangler::Untangler(Problem& problem, const Kernels& kernels, Guard& guard, const Team& team,
                     FailedStarts& failed_starts, Depth depth, std::int64_t hessian_bytes, SpareMemory spare)
    : Untangler(ToBeRead{}, problem, kernels, guard, team, failed_starts, depth, hessian_bytes, std::move(spare)) {
  first_repairable_ = guard.repairable();
  guard.return_to_kept();
  begin();
}

void Untangler::begin() {
  failed_starts_.resize(at(problem_.cells), 0);
  rebuild();
  first_unrepaired_ = guard_.unrepaired();
  find_patches(depth_.first, depth_.first);
}

void Untangler::find_patches(int layers, int stretched_layers) {
  layers_ = layers;
  patches_.clear();
  const std::vector<Standing> standings = present_standings();
  for (PatchFinder::Found& found : PatchFinder(problem_, standings, layers, stretched_layers).patches(standings)) {
    if (!fits_in_memory(found.members, problem_.dimension)) continue;
    team_.look_together();
    UntanglePatch patch(energies_, std::move(found.members), std::move(found.nodes), problem_.dimension, team_.stop());
    patch.find_lengths(problem_);
    Assessment first = assess(patch, standings);
    // What was lost before this patch does not count against it.
    first.merit.lost = 0;
    if (first.repairable == 0) continue;  // its free nodes cannot repair anything
    const Best best{first.merit, patch.positions()};
    patches_.push_back({.patch = patch,
                        .best_without_loss = best,
                        .best = best,
                        .fewest_bad = patch.bad_cells(),
                        .fewest_uncertified = first.repairable});
  }
  make_room();
}

void Untangler::make_room() {
  std::int64_t bytes = 0;
  for (const TrackedPatch& tracked : patches_) bytes += tracked.patch.hessian_bytes();
  room_.grow_to(bytes);
}

Untangler::Assessment Untangler::assess(const UntanglePatch& patch, std::span<const Standing> standings) const {
  Assessment result;
  for (const UntanglePatch::Member& member : patch.members()) {
    const Standing standing = standings[at(problem_.sets[at(member.set)].first + member.cell.number)];
    result.merit.lost += standing == Standing::Lost ? 1 : 0;
    result.merit.uncertified += standing == Standing::Valid ? 0 : 1;
    result.repairable += standing == Standing::Lost || standing == Standing::Uncertified ? 1 : 0;
  }
  result.merit.smallest = patch.smallest_coefficient();
  return result;
}

UntangleOutcome Untangler::step() {
  std::vector<UntangleStep> steps(patches_.size());
  team_.for_each(static_cast<std::int32_t>(patches_.size()), 1, [&](std::int32_t i) {
    if (patches_[at(i)].ended) return;
    steps[at(i)] = patches_[at(i)].patch.step(team_, room_);
  });
  UntangleOutcome outcome;
  for (std::size_t i = 0; i < patches_.size(); ++i) {
    if (patches_[i].ended) continue;
    const UntanglePatch& patch = patches_[i].patch;
    write(patch, patch.positions());
    outcome.residual = std::max(outcome.residual, steps[i].residual);
    outcome.gradient_norm = std::max(outcome.gradient_norm, steps[i].gradient_norm);
    outcome.active_nodes += static_cast<std::int64_t>(patch.nodes().size());
  }
  return outcome;
}

void Untangler::judge() {
  const std::vector<Standing> standings = present_standings();
  for (TrackedPatch& tracked : patches_)
    if (!tracked.ended) judge(tracked, standings);
  if (done()) finish();
}

void Untangler::judge(TrackedPatch& tracked, std::span<const Standing> standings) const {
  const Assessment now = assess(tracked.patch, standings);
  Merit with_loss = now.merit;
  with_loss.lost = 0;
  if (is_better(with_loss, tracked.best.merit, kAskForMinimum)) tracked.best = {with_loss, tracked.patch.positions()};
  if (is_better(now.merit, tracked.best_without_loss.merit, kAskForMinimum))
    tracked.best_without_loss = {now.merit, tracked.patch.positions()};
  const bool gained = tracked.patch.bad_cells() < tracked.fewest_bad || now.repairable < tracked.fewest_uncertified;
  tracked.without_fewer = gained ? 0 : tracked.without_fewer + 1;
  tracked.has_gained = tracked.has_gained || gained;
  const double depth = -now.merit.smallest;
  const bool rises = depth + kRise * std::abs(depth) < tracked.least_depth;
  tracked.without_rise = gained || rises ? 0 : tracked.without_rise + 1;
  tracked.least_depth = std::min(tracked.least_depth, depth);
  tracked.fewest_bad = std::min(tracked.fewest_bad, tracked.patch.bad_cells());
  tracked.fewest_uncertified = std::min(tracked.fewest_uncertified, now.repairable);
  tracked.ended = now.repairable == 0 || tracked.without_fewer >= (tracked.has_gained ? kPatience : kFirstPatience) ||
                  tracked.without_rise >= kMostStanding;
}

std::vector<Standing> Untangler::present_standings() const {
  std::vector<Standing> result = guard_.standings();
  for (std::size_t cell = 0; cell < result.size(); ++cell)
    if (result[cell] == Standing::Uncertified && failed_starts_[cell] >= kMostStarts)
      result[cell] = Standing::Unrepairable;
  return result;
}

void Untangler::count_failures() {
  const std::vector<Standing> standings = guard_.standings();
  for (const TrackedPatch& tracked : patches_)
    for (const UntanglePatch::Member& member : tracked.patch.members()) {
      const auto cell = at(problem_.sets[at(member.set)].first + member.cell.number);
      if (standings[cell] == Standing::Uncertified && failed_starts_[cell] < kMostStarts) ++failed_starts_[cell];
    }
}

void Untangler::finish() {
  for (const TrackedPatch& tracked : patches_) write(tracked.patch, tracked.best_without_loss.positions);
  guard_.certify_moved();
  count_failures();
  if ((guard_.unrepaired() > 0 || guard_.lost() > 0) && layers_ < depth_.second) {
    find_patches(depth_.second, depth_.stretched);
    if (!patches_.empty()) return;
  }
  for (const TrackedPatch& tracked : patches_)
    if (is_better(tracked.best.merit, tracked.best_without_loss.merit)) write(tracked.patch, tracked.best.positions);
  guard_.certify_moved();
  if (guard_.unrepaired() < first_unrepaired_ || guard_.repairable() < first_repairable_) return;
  problem_.positions = first_positions_;
  rebuild();
  guard_.certify_moved();
}

bool Untangler::done() const {
  return std::all_of(patches_.begin(), patches_.end(), [](const TrackedPatch& tracked) { return tracked.ended; });
}

void Untangler::rebuild() {
  hold_deformation(problem_, kernels_.keeps_function());
  for (CellSet& set : problem_.sets)
    team_.for_each(set.count, 64, [&](std::int32_t cell) { kernels_.rebuild(set, cell, problem_.positions); });
}

void Untangler::write(const UntanglePatch& patch, const Eigen::VectorXd& positions) {
  const int d = problem_.dimension;
  for (std::size_t n = 0; n < patch.nodes().size(); ++n)
    for (int k = 0; k < d; ++k)
      problem_.positions[at(patch.nodes()[n]) * at(d) + at(k)] = positions[static_cast<Eigen::Index>(n) * d + k];
  team_.for_each(static_cast<std::int32_t>(patch.members().size()), 16, [&](std::int32_t i) {
    const UntanglePatch::Member& member = patch.members()[at(i)];
    kernels_.rebuild(problem_.sets[at(member.set)], member.cell.number, problem_.positions);
  });
}

}  // namespace varimesh
