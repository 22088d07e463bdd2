#include "core/guard/guard.h"

#include <algorithm>
#include <iterator>
#include <numeric>

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
constexpr std::size_t kCellsPerTask = 512;

/// The arrays have the same size. It is never interrupted.
void copy_in_parallel(const std::vector<double>& from, std::vector<double>& to, const Team& team) {
  team.without_stop().for_ranges(from.size(), 4 * kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    std::copy_n(from.data() + begin, end - begin, to.data() + begin);
  });
}

}  // namespace

Guard::Guard(const HighOrderMesh& mesh, const Frame& frame, Problem& problem, const Certifier& certifier,
             std::vector<Certificate> certificates, const Team& team)
    : mesh_(mesh),
      problem_(problem),
      certifier_(certifier),
      team_(team),
      conversion_(mesh, frame, problem.positions),
      free_(mesh.node_count(), 0),
      unrepairable_(problem.cells, 0),
      positions_(problem.positions),
      certificates_(std::move(certificates)),
      latest_positions_(positions_),
      latest_coordinates_(mesh.coordinates),
      latest_certificates_(certificates_) {
  for (const std::int32_t node : problem.free) free_[node] = 1;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension) continue;
    const int size = reference::node_count(block.shape, block.order);
    for (std::size_t e = 0; e < block.size(); ++e) {
      cell_nodes_.push_back(block.nodes.data() + e * static_cast<std::size_t>(size));
      cell_size_.push_back(size);
    }
  }
  count();
}

void Guard::set_unrepairable(std::span<const UnrepairableGroup> groups) {
  for (const UnrepairableGroup& group : groups)
    for (const std::int32_t cell : group.cells) unrepairable_[cell] = 1;
  count();
}

std::vector<std::int32_t> Guard::moved_cells(const std::vector<double>& positions) const {
  const std::size_t d = problem_.dimension;
  std::vector<char> moved(mesh_.node_count(), 0), touched(cell_nodes_.size(), 0);
  team_.for_ranges(problem_.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t rank = begin; rank < end; ++rank) {
      const std::size_t node = problem_.free[rank];
      moved[node] = std::equal(&positions[node * d], &positions[node * d] + d, &latest_positions_[node * d]) ? 0 : 1;
    }
  });
  team_.for_ranges(cell_nodes_.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end; ++cell)
      touched[cell] = std::any_of(cell_nodes_[cell], cell_nodes_[cell] + cell_size_[cell],
                                  [&](std::int32_t node) { return moved[node] != 0; })
                          ? 1
                          : 0;
  });
  std::vector<std::int32_t> cells;
  for (std::size_t cell = 0; cell < touched.size(); ++cell)
    if (touched[cell] != 0) cells.push_back(static_cast<std::int32_t>(cell));
  return cells;
}

void Guard::certify_at(const std::vector<double>& positions) {
  std::vector<std::int32_t> moved;
  std::ranges::set_union(moved_cells(positions), unfinished_, std::back_inserter(moved));
  unfinished_ = moved;  // if this is interrupted, nothing is known about these cells
  kept_is_latest_ = kept_is_latest_ && moved.empty();
  conversion_.update(positions, moved, latest_coordinates_, team_);
  certifier_.certify(latest_coordinates_, moved, latest_certificates_, team_);
  copy_in_parallel(positions, latest_positions_, team_);
  unfinished_.clear();
  kept_is_latest_ = false;
  lost_.clear();
  for (std::size_t cell = 0; cell < latest_certificates_.size(); ++cell)
    if (certificates_[cell].is_valid() && !latest_certificates_[cell].is_valid())
      lost_.push_back(static_cast<std::int32_t>(cell));
}

void Guard::keep() {
  copy_in_parallel(latest_positions_, positions_, team_);
  certificates_ = latest_certificates_;
  kept_is_latest_ = true;
}

std::vector<double> Guard::coordinates() const {
  if (kept_is_latest_) return latest_coordinates_;
  std::vector<std::int32_t> cells(cell_nodes_.size());
  std::iota(cells.begin(), cells.end(), 0);
  std::vector<double> coordinates = mesh_.coordinates;
  conversion_.update(positions_, cells, coordinates, team_.without_stop());
  return coordinates;
}

bool Guard::restore(const std::vector<double>& kept, const std::vector<double>& latest) {
  std::vector<double> positions = problem_.positions;
  if (!set_free_positions(problem_, kept, positions)) return false;
  certify_at(positions);
  keep();
  if (!set_free_positions(problem_, latest, positions)) return false;
  certify_at(positions);
  count();
  return true;
}

void Guard::certify_moved() {
  const TimeAdder stopwatch(seconds_);
  certify_at(problem_.positions);
  if (lost_.empty()) keep();
  count();
}

void Guard::restore_lost() {
  const TimeAdder stopwatch(seconds_);
  std::vector<double> positions = problem_.positions;
  for (certify_at(positions); !lost_.empty(); certify_at(positions))
    for (const std::int32_t cell : lost_)
      for (int i = 0; i < cell_size_[cell]; ++i) {
        const std::int32_t node = cell_nodes_[cell][i];
        const std::size_t at = static_cast<std::size_t>(node) * problem_.dimension;
        if (free_[node] != 0) std::copy_n(&positions_[at], problem_.dimension, &positions[at]);
      }
  keep();
  count();
}

void Guard::return_to_kept() {
  restore_lost();
  problem_.positions = positions_;
}

std::int64_t Guard::unrepaired() const {
  std::int64_t sum = 0;
  for (std::size_t cell = 0; cell < latest_certificates_.size(); ++cell)
    sum += !certificates_[cell].is_valid() && unrepairable_[cell] == 0 ? 1 : 0;
  return sum;
}

std::vector<Standing> Guard::standings() const {
  std::vector<Standing> result;
  for (const CellSet& set : problem_.sets)
    for (const std::int32_t number : set.mesh_cell)
      result.push_back(latest_certificates_[number].is_valid() ? Standing::Valid
                       : certificates_[number].is_valid()      ? Standing::Lost
                       : unrepairable_[number] != 0            ? Standing::Unrepairable
                                                               : Standing::Uncertified);
  return result;
}

void Guard::count() {
  uncertified_ = repairable_ = 0;
  for (std::size_t cell = 0; cell < latest_certificates_.size(); ++cell) {
    if (latest_certificates_[cell].is_valid()) continue;
    ++uncertified_;
    repairable_ += unrepairable_[cell] == 0 ? 1 : 0;
  }
  write_unrepairable();
}

void Guard::write_unrepairable() {
  for (CellSet& set : problem_.sets) {
    set.unrepairable.resize(set.count);
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      const std::size_t number = set.mesh_cell[cell];
      set.unrepairable[cell] = unrepairable_[number] != 0 && !latest_certificates_[number].is_valid() ? 1 : 0;
    }
  }
}

}  // namespace varimesh
