#include "core/parts/senses.h"

#include <algorithm>

#include "core/base/index.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

/// What a group of a part encloses with one of its outer facets, if its cells have their senses.
struct Enclosed {
  std::int64_t group = 0;
  double volume = 0;
};

std::vector<Enclosed> enclosed_by_part(const Part& part, const Facets& facets, const detail::JoinedCells& joined,
                                       std::int64_t first_group, const Seams& seams, const BoundingBox& box,
                                       const Team& team) {
  const Cells cells(part.mesh, part.mesh.dimension);
  std::vector<detail::CellFacet> outer;
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (std::int32_t f = facets.first[cell]; f < facets.first[cell + 1]; ++f) {
      if (facets.neighbour[at(f)] >= 0) continue;
      const FacetKey key = facet_key(part.mesh, cells, cell, at(f - facets.first[cell]));
      if (seams.is_outer(key) || std::ranges::binary_search(seams.unclear, key))
        outer.push_back({static_cast<std::int32_t>(cell), f - facets.first[cell]});
    }
  const auto volumes = detail::facet_volumes(part.mesh, cells, outer, detail::centre(box), team);
  std::vector<Enclosed> enclosed;
  for (std::size_t i = 0; i < outer.size(); ++i) {
    const auto cell = at(outer[i].cell);
    enclosed.push_back({first_group + joined.group[cell], joined.sense[cell] * volumes[i]});
  }
  return enclosed;
}

/// A forest of groups that hang together. A root is the lowest of its groups.
class Forest {
 public:
  explicit Forest(std::size_t groups) : parent_(groups), relation_(groups, 1) {
    for (std::size_t g = 0; g < groups; ++g) parent_[g] = g;
  }

  /// The root, and whether the group has its sense (1) or the opposite one (−1).
  std::pair<std::size_t, int> root(std::size_t group) {
    std::size_t top = group;
    int relation = 1;
    for (; parent_[top] != top; top = parent_[top]) relation *= relation_[top];
    for (int of_rest = relation; parent_[group] != top && group != top;) {
      const std::size_t next = parent_[group];
      const int own = relation_[group];
      parent_[group] = top;
      relation_[group] = of_rest;
      of_rest *= own;
      group = next;
    }
    return {top, relation};
  }

  /// Joins two groups. Returns whether their relation fits what is known.
  bool join(std::size_t one, std::size_t other, int relation) {
    const auto [a, of_a] = root(one);
    const auto [b, of_b] = root(other);
    if (a == b) return of_a * of_b == relation;
    parent_[std::max(a, b)] = std::min(a, b);
    relation_[std::max(a, b)] = of_a * of_b * relation;
    return true;
  }

 private:
  std::vector<std::size_t> parent_;
  std::vector<int> relation_;  // to the parent
};

/// For each group of all ranks: 1 if its cells with the sense −1 are clockwise, −1 if those with the sense 1 are, and 0
/// if none is.
std::vector<std::int8_t> turns(std::vector<detail::JoinedCells::Group> groups, const std::vector<GroupLink>& links,
                               const std::vector<Enclosed>& enclosed) {
  Forest forest(groups.size());
  std::vector<GroupLink> wrong;
  for (const GroupLink& link : links)
    if (!forest.join(at(link.one), at(link.other), static_cast<int>(link.relation))) wrong.push_back(link);
  for (const GroupLink& link : wrong) groups[forest.root(at(link.one)).first].is_consistent = false;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const auto [root, relation] = forest.root(g);
    groups[root].is_consistent &= groups[g].is_consistent;
    groups[root].is_upright &= groups[g].is_upright && relation > 0;
  }
  std::vector<ExactSum> volume(groups.size());
  for (const Enclosed& part : enclosed) {
    const auto [root, relation] = forest.root(at(part.group));
    volume[root].add(relation * part.volume);
  }
  std::vector<std::int8_t> turn(groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const auto [root, relation] = forest.root(g);
    const bool is_turned = !groups[root].is_upright && volume[root].value() < 0;
    if (groups[root].is_consistent) turn[g] = static_cast<std::int8_t>(is_turned ? -relation : relation);
  }
  return turn;
}

}  // namespace

std::vector<char> clockwise_cells(const Part& part, const Facets& facets, const detail::JoinedCells& joined,
                                  const std::vector<std::int8_t>& signs, std::int64_t first_group, const Seams& seams,
                                  const BoundingBox& box, const Ranks& ranks, const Team& team) {
  const std::int64_t others = std::ssize(signs) - std::ranges::count(signs, 1);
  if (ranks.sum(others) == 0 && seams.all_agree) return {};
  const auto groups = ranks.gather(joined.groups);
  const auto enclosed = ranks.gather(enclosed_by_part(part, facets, joined, first_group, seams, box, team));
  std::vector<std::int8_t> turn;
  if (ranks.is_first()) turn = turns(groups, seams.links, enclosed);
  turn = ranks.gather_everywhere(turn);
  std::vector<char> clockwise(joined.group.size());
  for (std::size_t cell = 0; cell < clockwise.size(); ++cell)
    clockwise[cell] = turn[at(first_group + joined.group[cell])] * joined.sense[cell] < 0 ? 1 : 0;
  if (ranks.sum(std::ranges::count(clockwise, 1)) == 0) return {};
  return clockwise;
}

}  // namespace varimesh
