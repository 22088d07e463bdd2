#include "core/solvers/guard/guard.h"

#include <algorithm>
#include <iterator>
#include <numeric>

#include "core/base/io/large_arrays.h"
#include "core/base/shared_work.h"
#include "core/base/stopwatch.h"

namespace varimesh {
namespace {

/// Adds the time between its construction and its destruction to a sum.
class TimeAdder {
 public:
  explicit TimeAdder(double& sum) : sum_(sum) {}
  ~TimeAdder() { sum_ += watch_.seconds(); }
  TimeAdder(const TimeAdder&) = delete;
  TimeAdder& operator=(const TimeAdder&) = delete;

 private:
  Stopwatch watch_;
  double& sum_;
};

constexpr std::size_t kNodesPerTask = 4096;
constexpr std::size_t kCellsPerChunk = 4096;

std::int64_t uncertified_in(const std::vector<Certificate>& certificates, const Team& team) {
  return count_where(team.without_stop(), certificates.size(), kCellsPerChunk,
                     [&](std::size_t cell) { return !certificates[cell].is_valid(); });
}

}  // namespace

Guard::Guard(const HighOrderMesh& mesh, const Frame& frame, Problem& problem, const Certifier& certifier,
             std::vector<Certificate> certificates, const Team& team, const Ranks& ranks)
    : mesh_(mesh),
      problem_(problem),
      certifier_(certifier),
      team_(team),
      ranks_(ranks),
      conversion_(mesh, frame, problem.positions, team),
      free_(mesh.node_count(), 0),
      unrepairable_(problem.cells, 0),
      beyond_repair_(problem.cells, 0),
      positions_(shared_copy(problem.positions, team)),
      certificates_(std::move(certificates)),
      latest_positions_(shared_copy(problem.positions, team)),
      latest_coordinates_(shared_copy(mesh.coordinates, team)),
      latest_certificates_(certificates_) {
  team.for_ranges(problem.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t rank = begin; rank < end; ++rank) free_[problem.free[rank]] = 1;
  });
  cell_nodes_.resize(certificates_.size());
  cell_size_.resize(certificates_.size());
  std::size_t first = 0;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension) continue;
    const int size = reference::node_count(block.shape, block.order);
    team.for_ranges(block.size(), kCellsPerChunk, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e) {
        cell_nodes_[first + e] = block.nodes.data() + e * static_cast<std::size_t>(size);
        cell_size_[first + e] = size;
      }
    });
    first += block.size();
  }
  kept_uncertified_ = uncertified_in(certificates_, team_);
  count();
}

void Guard::set_unrepairable(std::span<const UnrepairableGroup> groups) {
  for (const UnrepairableGroup& group : groups)
    for (const std::int32_t cell : group.cells) unrepairable_[cell] = 1;
  beyond_repair_ = cells_beyond_repair(groups, unrepairable_.size());
  count();
}

template <class Is>
std::vector<std::int32_t> Guard::cells_where(const Is& is) const {
  return indices_where(team_.without_stop(), cell_nodes_.size(), kCellsPerChunk, is);
}

std::vector<std::int32_t> Guard::moved_cells(const std::vector<double>& positions) const {
  const std::size_t d = problem_.dimension;
  std::vector<char> moved(mesh_.node_count(), 0);
  team_.for_ranges(problem_.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t rank = begin; rank < end; ++rank) {
      const std::size_t node = problem_.free[rank];
      moved[node] = std::equal(&positions[node * d], &positions[node * d] + d, &latest_positions_[node * d]) ? 0 : 1;
    }
  });
  return cells_where([&](std::size_t cell) {
    return std::any_of(cell_nodes_[cell], cell_nodes_[cell] + cell_size_[cell],
                       [&](std::int32_t node) { return moved[node] != 0; });
  });
}

void Guard::certify_at(const std::vector<double>& positions) {
  std::vector<std::int32_t> moved;
  std::ranges::set_union(moved_cells(positions), unfinished_, std::back_inserter(moved));
  unfinished_ = moved;  // if this is interrupted, nothing is known about these cells
  kept_is_latest_ = kept_is_latest_ && moved.empty();
  conversion_.update(positions, moved, latest_coordinates_, team_, ranks_);
  certifier_.certify(latest_coordinates_, moved, latest_certificates_, team_, ranks_);
  shared_copy<double>(positions, latest_positions_, team_);
  unfinished_.clear();
  kept_is_latest_ = false;
  lost_ = cells_where(
      [&](std::size_t cell) { return certificates_[cell].is_valid() && !latest_certificates_[cell].is_valid(); });
}

void Guard::keep() {
  shared_copy<double>(latest_positions_, positions_, team_);
  shared_copy<Certificate>(latest_certificates_, certificates_, team_);
  kept_is_latest_ = true;
  kept_uncertified_ = uncertified_in(certificates_, team_);
  if (!is_better(best_.merit, {.uncertified = kept_uncertified_})) best_ = {};
}

std::vector<double> Guard::coordinates() const {
  std::vector<double> coordinates;
  copy_coordinates(coordinates);
  return coordinates;
}

void Guard::copy_coordinates(std::vector<double>& coordinates) const {
  resize_large(coordinates, mesh_.coordinates.size());
  if (kept_is_latest_) return shared_copy<double>(latest_coordinates_, coordinates, team_);
  std::vector<std::int32_t> cells(cell_nodes_.size());
  std::iota(cells.begin(), cells.end(), 0);
  shared_copy<double>(mesh_.coordinates, coordinates, team_);
  conversion_.update(positions_, cells, coordinates, team_.without_stop());
}

bool Guard::restore(const std::vector<double>& kept, const std::vector<double>& latest) {
  std::vector<double> positions = problem_.positions;
  Ending best;
  best.positions.swap(best_.positions);
  if (!best.positions.empty()) {
    if (!set_free_positions(problem_, best.positions, positions)) return false;
    certify_at(positions);
    best.certificates = latest_certificates_;
    best.merit.uncertified = uncertified_in(best.certificates, team_);
  }
  if (!set_free_positions(problem_, kept, positions)) return false;
  certify_at(positions);
  keep();
  best_ = std::move(best);
  if (!set_free_positions(problem_, latest, positions)) return false;
  certify_at(positions);
  count();
  return true;
}

void Guard::certify_moved() {
  const TimeAdder stopwatch(seconds_);
  certify_at(problem_.positions);
  if (lost_.empty())
    keep();
  else
    try_to_end_here();
  count();
}

void Guard::try_to_end_here() {
  // At best only the lost cells become valid again.
  const Merit so_far{.uncertified = fewest()};
  if (!is_better({.uncertified = uncertified_in(latest_certificates_, team_) - lost()}, so_far)) return;
  put_back_lost();
  if (const Merit merit{.uncertified = uncertified_in(latest_certificates_, team_)}; is_better(merit, so_far))
    best_ = {free_positions(problem_, latest_positions_), latest_certificates_, merit};
  certify_at(problem_.positions);
}

bool Guard::return_to_best() {
  if (best_.positions.empty()) return false;
  std::vector<double> positions = problem_.positions;
  set_free_positions(problem_, best_.positions, positions);
  shared_copy<double>(positions, positions_, team_);
  certificates_ = std::move(best_.certificates);
  kept_uncertified_ = best_.merit.uncertified;
  kept_is_latest_ = false;
  best_ = {};
  return true;
}

void Guard::restore_lost() {
  const TimeAdder stopwatch(seconds_);
  certify_at(problem_.positions);
  put_back_lost();
  keep();
  count();
}

void Guard::put_back_lost() {
  std::vector<double> positions(latest_positions_.begin(), latest_positions_.end());
  for (; !lost_.empty(); certify_at(positions))
    for (const std::int32_t cell : lost_)
      for (int i = 0; i < cell_size_[cell]; ++i) {
        const std::int32_t node = cell_nodes_[cell][i];
        const std::size_t at = static_cast<std::size_t>(node) * problem_.dimension;
        if (free_[node] != 0) std::copy_n(&positions_[at], problem_.dimension, &positions[at]);
      }
}

void Guard::return_to_kept() {
  restore_lost();
  shared_copy<double>(positions_, problem_.positions, team_);
}

void Guard::return_to_ending() {
  restore_lost();
  return_to_best();
  shared_copy<double>(positions_, problem_.positions, team_);
  certify_moved();
}

std::int64_t Guard::unrepaired() const {
  return count_where(team_.without_stop(), cell_nodes_.size(), kCellsPerChunk,
                     [&](std::size_t cell) { return !certificates_[cell].is_valid() && unrepairable_[cell] == 0; });
}

std::vector<Standing> Guard::standings() const {
  std::vector<Standing> result(static_cast<std::size_t>(problem_.cells));
  for (const CellSet& set : problem_.sets)
    team_.without_stop().for_each(set.count, static_cast<std::int32_t>(kCellsPerChunk), [&](std::int32_t cell) {
      const std::int32_t number = set.mesh_cell[cell];
      result[set.first + cell] = latest_certificates_[number].is_valid() ? Standing::Valid
                                 : certificates_[number].is_valid()      ? Standing::Lost
                                 : unrepairable_[number] != 0            ? Standing::Unrepairable
                                                                         : Standing::Uncertified;
    });
  return result;
}

void Guard::count() {
  const std::vector<std::int32_t> bad =
      cells_where([&](std::size_t cell) { return !latest_certificates_[cell].is_valid(); });
  uncertified_ = static_cast<std::int64_t>(bad.size());
  repairable_ = std::ranges::count_if(bad, [&](std::int32_t cell) { return unrepairable_[cell] == 0; });
  write_unrepairable();
}

void Guard::write_unrepairable() {
  for (CellSet& set : problem_.sets) {
    set.unrepairable.resize(set.count);
    team_.without_stop().for_each(set.count, static_cast<std::int32_t>(kCellsPerChunk), [&](std::int32_t cell) {
      const std::size_t number = set.mesh_cell[cell];
      set.unrepairable[cell] = unrepairable_[number] != 0 && !latest_certificates_[number].is_valid() ? 1 : 0;
    });
  }
}

}  // namespace varimesh
