#include "core/repair/choose_splits.h"

#include <algorithm>
#include <map>
#include <queue>
#include <set>

#include "core/base/index.h"

namespace varimesh {

std::vector<SplitPlace> choose_splits(std::span<const WeakGroup> groups, const SplitRules& rules) {
  struct Candidate {
    std::vector<std::size_t> groups;
    std::vector<std::int32_t> cells;
  };
  std::map<SplitPlace, Candidate> candidates;
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (const SplitPlace& place : groups[g].candidates) candidates[place].groups.push_back(g);
  for (auto& [place, candidate] : candidates) candidate.cells = rules.cells_around(place);
  std::vector<bool> covered(groups.size(), false);
  std::set<std::int32_t> taken;
  const auto rate = [&](const SplitPlace& place, const Candidate& candidate) {
    if (std::ranges::any_of(candidate.cells, [&](std::int32_t cell) { return taken.contains(cell); })) return 0.0;
    const auto gained = std::ranges::count_if(candidate.groups, [&](std::size_t g) { return !covered[g]; });
    return static_cast<double>(gained) / static_cast<double>(candidate.cells.size() * at(vertex_count(place) - 1));
  };
  // Rates only fall. If the top candidate's rate still holds, it is the best one. Equal rates go by place.
  struct Entry {
    double rate;
    SplitPlace place;
    bool operator<(const Entry& other) const { return rate != other.rate ? rate < other.rate : place > other.place; }
  };
  std::priority_queue<Entry> queue;
  for (const auto& [place, candidate] : candidates) queue.push({rate(place, candidate), place});
  std::vector<SplitPlace> result;
  while (!queue.empty()) {
    const Entry top = queue.top();
    queue.pop();
    const Candidate& candidate = candidates[top.place];
    const double now = rate(top.place, candidate);
    if (now <= 0) continue;
    if (now < top.rate) {
      queue.push({now, top.place});
      continue;
    }
    result.push_back(top.place);
    for (const std::size_t g : candidate.groups) covered[g] = true;
    taken.insert(candidate.cells.begin(), candidate.cells.end());
  }
  return result;
}

}  // namespace varimesh
