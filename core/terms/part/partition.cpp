#include "core/terms/part/partition.h"

#include <algorithm>

#include "core/base/shared_work.h"

namespace varimesh {
namespace {

/// By cluster: its rank.
std::vector<std::int32_t> ranks_of_clusters(const Problem& problem, int ranks) {
  std::vector<std::int64_t> work(at(problem.clusters), 0);
  for (const CellSet& set : problem.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell)
      work[at(problem.cluster[at(set.first + cell)])] += std::int64_t{set.points} * set.nodes_per_cell;
  std::vector<std::int64_t> before = work;
  const std::int64_t all = std::max<std::int64_t>(sums_before(before), 1);
  std::vector<std::int32_t> rank;
  for (std::size_t cluster = 0; cluster < work.size(); ++cluster) {
    const double middle = static_cast<double>(before[cluster]) + 0.5 * static_cast<double>(work[cluster]);
    rank.push_back(std::min(static_cast<std::int32_t>(middle * ranks / static_cast<double>(all)), ranks - 1));
  }
  return rank;
}

}  // namespace

Partition partition(const Problem& problem, int ranks) {
  const std::vector<std::int32_t> rank_of_cluster = ranks_of_clusters(problem, ranks);
  Partition result;
  result.ranks = ranks;
  const auto middle_of = [](std::size_t block, std::size_t count) {
    return std::min(block * Reduction::kBlock + Reduction::kBlock / 2, count - 1);
  };
  for (const CellSet& set : problem.sets) {
    std::vector<std::int32_t>& blocks = result.cell_blocks.emplace_back(chunks_of(at(set.count), Reduction::kBlock));
    for (std::size_t block = 0; block < blocks.size(); ++block)
      blocks[block] = rank_of_cluster[at(problem.cluster[at(set.first) + middle_of(block, at(set.count))])];
  }
  result.node_blocks.resize(chunks_of(problem.free.size(), Reduction::kBlock));
  for (std::size_t block = 0; block < result.node_blocks.size(); ++block) {
    const Incidence& first = problem.incidences[at(problem.offsets[middle_of(block, problem.free.size())])];
    result.node_blocks[block] = result.rank_of_cell(at(first.set), first.cell);
  }
  return result;
}

}  // namespace varimesh
