#include "core/optimise/guard.h"

#include <algorithm>
#include <chrono>
#include <numeric>

namespace varimesh {
namespace {

/// Adds the time until its end.
class Stopwatch {
 public:
  explicit Stopwatch(double& seconds) : seconds_(seconds) {}
  ~Stopwatch() { seconds_ += std::chrono::duration<double>(Clock::now() - start_).count(); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
  double& seconds_;
};

constexpr std::size_t kNodesPerTask = 4096;
constexpr std::size_t kCellsPerTask = 512;

/// Between arrays of the same size.
void copy_in_parallel(const std::vector<double>& from, std::vector<double>& to, const Team& team) {
  team.for_ranges(from.size(), 4 * kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    std::copy_n(from.data() + begin, end - begin, to.data() + begin);
  });
}

bool is_valid(const Certificate& certificate) { return certificate.answer == Certificate::Answer::Valid; }

}  // namespace

Guard::Guard(const HighOrderMesh& mesh, const Frame& frame, Problem& problem, const Certifier& certifier,
             std::vector<Certificate> certificates, const Team& team)
    : mesh_(mesh),
      problem_(problem),
      certifier_(certifier),
      team_(team),
      way_out_(mesh, frame, problem.positions),
      free_(mesh.node_count(), 0),
      named_(problem.cells, 0),
      positions_(problem.positions),
      certificates_(std::move(certificates)),
      seen_positions_(positions_),
      seen_coordinates_(mesh.coordinates),
      seen_(certificates_) {
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

void Guard::condemn(std::span<const UnrepairableGroup> groups) {
  for (const UnrepairableGroup& group : groups)
    for (const std::int32_t cell : group.cells) named_[cell] = 1;
  count();
}

std::vector<std::int32_t> Guard::moved_cells(const std::vector<double>& positions) const {
  const std::size_t d = problem_.dimension;
  std::vector<char> moved(mesh_.node_count(), 0), concerned(cell_nodes_.size(), 0);
  team_.for_ranges(problem_.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t rank = begin; rank < end; ++rank) {
      const std::size_t node = problem_.free[rank];
      moved[node] = std::equal(&positions[node * d], &positions[node * d] + d, &seen_positions_[node * d]) ? 0 : 1;
    }
  });
  team_.for_ranges(cell_nodes_.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end; ++cell)
      concerned[cell] = std::any_of(cell_nodes_[cell], cell_nodes_[cell] + cell_size_[cell],
                                    [&](std::int32_t node) { return moved[node] != 0; })
                            ? 1
                            : 0;
  });
  std::vector<std::int32_t> cells;
  for (std::size_t cell = 0; cell < concerned.size(); ++cell)
    if (concerned[cell] != 0) cells.push_back(static_cast<std::int32_t>(cell));
  return cells;
}

void Guard::see(const std::vector<double>& positions) {
  const std::vector<std::int32_t> moved = moved_cells(positions);
  way_out_.update(positions, moved, seen_coordinates_, team_);
  certifier_.certify(seen_coordinates_, moved, seen_, team_);
  copy_in_parallel(positions, seen_positions_, team_);
  kept_is_seen_ = false;
  lost_.clear();
  for (std::size_t cell = 0; cell < seen_.size(); ++cell)
    if (is_valid(certificates_[cell]) && !is_valid(seen_[cell])) lost_.push_back(static_cast<std::int32_t>(cell));
}

void Guard::keep() {
  copy_in_parallel(seen_positions_, positions_, team_);
  certificates_ = seen_;
  kept_is_seen_ = true;
}

std::vector<double> Guard::coordinates() const {
  if (kept_is_seen_) return seen_coordinates_;
  std::vector<std::int32_t> cells(cell_nodes_.size());
  std::iota(cells.begin(), cells.end(), 0);
  std::vector<double> coordinates = mesh_.coordinates;
  way_out_.update(positions_, cells, coordinates, team_);
  return coordinates;
}

bool Guard::restore(const std::vector<double>& kept, const std::vector<double>& seen) {
  std::vector<double> positions = problem_.positions;
  if (!set_free_positions(problem_, kept, positions)) return false;
  see(positions);
  keep();
  if (!set_free_positions(problem_, seen, positions)) return false;
  see(positions);
  count();
  return true;
}

std::vector<double> Guard::free_of(const std::vector<double>& positions) const {
  return free_positions(problem_, positions);
}

void Guard::look() {
  const Stopwatch stopwatch(seconds_);
  see(problem_.positions);
  if (lost_.empty()) keep();
  count();
}

void Guard::settle() {
  const Stopwatch stopwatch(seconds_);
  std::vector<double> positions = problem_.positions;
  for (see(positions); !lost_.empty(); see(positions))
    for (const std::int32_t cell : lost_)
      for (int i = 0; i < cell_size_[cell]; ++i) {
        const std::int32_t node = cell_nodes_[cell][i];
        const std::size_t at = static_cast<std::size_t>(node) * problem_.dimension;
        if (free_[node] != 0) std::copy_n(&positions_[at], problem_.dimension, &positions[at]);
      }
  keep();
  count();
}

void Guard::return_to_best() {
  settle();
  problem_.positions = positions_;
}

std::int64_t Guard::unrepaired() const {
  std::int64_t sum = 0;
  for (std::size_t cell = 0; cell < seen_.size(); ++cell)
    sum += !is_valid(certificates_[cell]) && named_[cell] == 0 ? 1 : 0;
  return sum;
}

std::vector<Standing> Guard::standings() const {
  std::vector<Standing> result;
  for (const CellBlock& block : problem_.blocks)
    for (const std::int32_t number : block.mesh_cell)
      result.push_back(is_valid(seen_[number])           ? Standing::Valid
                       : is_valid(certificates_[number]) ? Standing::Lost
                       : named_[number] != 0             ? Standing::Condemned
                                                         : Standing::Uncertified);
  return result;
}

void Guard::count() {
  uncertified_ = repairable_ = 0;
  for (std::size_t cell = 0; cell < seen_.size(); ++cell) {
    if (is_valid(seen_[cell])) continue;
    ++uncertified_;
    repairable_ += named_[cell] == 0 ? 1 : 0;
  }
  set_condemned();
}

void Guard::set_condemned() {
  for (CellBlock& block : problem_.blocks) {
    block.condemned.resize(block.count);
    for (std::int32_t cell = 0; cell < block.count; ++cell) {
      const std::size_t number = block.mesh_cell[cell];
      block.condemned[cell] = named_[number] != 0 && !is_valid(seen_[number]) ? 1 : 0;
    }
  }
}

}  // namespace varimesh
