#include "core/terms/part/cell_sum.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/base/index.h"
#include "core/base/reduction.h"
#include "core/base/shared_work.h"

namespace varimesh {

CellSum::CellSum(const ProblemPart& part) {
  const Problem& whole = *part.whole;
  const std::int32_t rank = part.share.ranks->rank();
  std::vector<std::int32_t> works;  // by cell of the whole problem
  for (std::size_t s = 0; s < whole.sets.size(); ++s)
    for (std::int32_t cell = 0; cell < whole.sets[s].count; ++cell)
      works.push_back(part.partition.rank_of_cell(s, cell));
  std::map<std::int32_t, Halo::Neighbour::Items> lists;
  // The rank's own cells have the order that they have in the whole problem.
  std::int32_t own = 0, next = part.problem.cells;
  for (std::size_t cell = 0; cell < works.size(); ++cell) {
    const std::int32_t adds_up = works[cell / Reduction::kBlock * Reduction::kBlock];
    if (works[cell] == rank && adds_up == rank) {
      terms_.push_back(own++);
    } else if (works[cell] == rank) {
      lists[adds_up].send.push_back(static_cast<Halo::Item>(own++));
    } else if (adds_up == rank) {
      lists[works[cell]].receive.push_back(static_cast<Halo::Item>(next));
      terms_.push_back(next++);
    }
  }
  numbers_.resize(at(next));
  std::vector<Halo::Neighbour> neighbours;
  for (auto& [other, items] : lists) neighbours.push_back({other, {std::move(items)}});
  halo_ = Halo(std::move(neighbours));
}

double CellSum::sum(std::span<const double> values, const WholeReduction& reduction, std::size_t grain) {
  std::ranges::copy(values, numbers_.begin());
  halo_.exchange(numbers_.data(), 1, reduction.ranks());
  return reduction.sum(terms_.size(), grain, [&](std::size_t i) { return numbers_[at(terms_[i])]; });
}

}  // namespace varimesh
