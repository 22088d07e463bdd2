#include "core/preconditioner/coarse_part.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "core/base/index.h"
#include "core/kernels/hessian/batches.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNone = -1;

using Neighbours = std::map<std::int32_t, Halo::Neighbour>;

Halo::Neighbour::Items& items_for(Neighbours& all, std::int32_t rank, std::size_t arrays, std::size_t array) {
  Halo::Neighbour& found = all[rank];
  found.rank = rank;
  found.arrays.resize(arrays);
  return found.arrays[array];
}

Halo halo_of(Neighbours all) {
  std::vector<Halo::Neighbour> neighbours;
  for (auto& [_, one] : all) neighbours.push_back(std::move(one));
  return Halo(std::move(neighbours));
}

/// The work of coarse_part(). Both ends of a message go through the same cells and nodes in the same order.
class CoarsePartMaker {
 public:
  CoarsePartMaker(const CoarseSpace& whole, const ProblemPart& part)
      : whole_(whole), part_(part), rank_(part.share.ranks->rank()), owner_(ranks_of_coarse_nodes(whole, part)) {}

  CoarsePart make(const std::vector<std::int32_t>& colours) {
    choose_nodes();
    for (const std::int32_t begin : colours)
      made_.colours.push_back(
          static_cast<std::int32_t>(std::ranges::lower_bound(made_.numbers, begin) - made_.numbers.begin()));
    list_cells();
    list_contributions();
    list_nodes();
    return std::move(made_);
  }

 private:
  bool is_own_cell(std::size_t set, std::size_t place) const { return place < at(part_.problem.sets[set].count); }
  std::int32_t* nodes_of(std::size_t set, std::size_t place) {
    return made_.space.sets[set].nodes.data() + place * at(made_.space.sets[set].nodes_per_cell);
  }
  std::int32_t owner_of(std::int32_t node) const { return owner_[at(made_.numbers[at(node)])]; }

  /// Calls use(set, place) for the cells that are there, own ones and ghosts.
  template <class Use>
  void for_cells(const Use& use) const {
    for (std::size_t s = 0; s < part_.cells.size(); ++s)
      for (std::size_t place = 0; place < part_.cells[s].size(); ++place)
        if (part_.cells[s][place] != kNone) use(s, place);
  }

  void choose_nodes() {
    CoarseSpace& space = made_.space;
    space.order = whole_.order;
    for (std::size_t s = 0; s < whole_.sets.size(); ++s) {
      const CoarseSpace::Set& from = whole_.sets[s];
      const std::size_t per_cell = at(from.nodes_per_cell);
      space.sets.push_back({from.nodes_per_cell, std::vector<std::int32_t>(part_.cells[s].size() * per_cell, kNone),
                            from.stiffness, from.values});
    }
    for_cells([&](std::size_t s, std::size_t place) {
      const std::size_t per_cell = at(whole_.sets[s].nodes_per_cell);
      const std::int32_t* from = whole_.sets[s].nodes.data() + at(part_.cells[s][place]) * per_cell;
      std::copy_n(from, per_cell, nodes_of(s, place));
      std::copy_if(from, from + per_cell, std::back_inserter(made_.numbers), [](std::int32_t n) { return n >= 0; });
    });
    std::vector<std::int32_t>& numbers = made_.numbers;
    std::ranges::sort(numbers);
    numbers.erase(std::ranges::unique(numbers).begin(), numbers.end());
    for (CoarseSpace::Set& set : space.sets)
      for (std::int32_t& node : set.nodes)
        if (node >= 0) node = static_cast<std::int32_t>(std::ranges::lower_bound(numbers, node) - numbers.begin());
    space.count = static_cast<std::int32_t>(numbers.size());
    for (std::int32_t node = 0; node < space.count; ++node) made_.is_own.push_back(owner_of(node) == rank_ ? 1 : 0);
  }

  void list_cells() {
    std::vector<std::vector<Incidence>> of(at(made_.space.count));
    for_cells([&](std::size_t s, std::size_t place) {
      for (int n = 0; n < made_.space.sets[s].nodes_per_cell; ++n)
        if (const std::int32_t node = nodes_of(s, place)[n]; node >= 0 && made_.is_own[at(node)] != 0)
          of[at(node)].push_back(
              {static_cast<std::int32_t>(place), static_cast<std::int16_t>(s), static_cast<std::int16_t>(n)});
    });
    made_.cells.begin.push_back(0);
    for (std::vector<Incidence>& list : of) {
      std::ranges::sort(list, {}, [&](const Incidence& in) {
        return std::array<std::int32_t, 2>{in.set, part_.cells[at(in.set)][at(in.cell)]};
      });
      made_.cells.incidences.insert(made_.cells.incidences.end(), list.begin(), list.end());
      made_.cells.begin.push_back(static_cast<std::int64_t>(made_.cells.incidences.size()));
    }
  }

  void list_contributions() {
    Neighbours all;
    for_cells([&](std::size_t s, std::size_t place) {
      const bool own = is_own_cell(s, place);
      const int per_cell = made_.space.sets[s].nodes_per_cell;
      for (int n = 0; n < per_cell; ++n) {
        const std::int32_t node = nodes_of(s, place)[n];
        if (node < 0 || (made_.is_own[at(node)] != 0) == own) continue;
        const std::int32_t other = own ? owner_of(node) : part_.partition.rank_of_cell(s, part_.cells[s][place]);
        Halo::Neighbour::Items& items = items_for(all, other, part_.cells.size(), s);
        const std::size_t item =
            contribution_index(static_cast<std::int32_t>(place), n, static_cast<std::uint32_t>(per_cell), 1);
        (own ? items.send : items.receive).push_back(static_cast<Halo::Item>(item));
      }
    });
    made_.contributions = halo_of(std::move(all));
  }

  /// The ranks that have this cell, its own one and those that own nodes of it, without this rank.
  std::vector<std::int32_t> ranks_with(std::size_t set, std::int32_t cell) const {
    std::vector<std::int32_t> ranks{part_.partition.rank_of_cell(set, cell)};
    const CellSet& cells = part_.whole->sets[set];
    for (int n = 0; n < cells.nodes_per_cell; ++n) {
      const std::int32_t free = free_[at(cells.nodes[at(cell) * at(cells.nodes_per_cell) + at(n)])];
      if (free != kNone) ranks.push_back(part_.partition.rank_of_node(free));
    }
    std::ranges::sort(ranks);
    ranks.erase(std::ranges::unique(ranks).begin(), ranks.end());
    std::erase(ranks, rank_);
    return ranks;
  }

  void list_nodes() {
    free_ = places_in_free(*part_.whole);
    std::map<std::int32_t, std::vector<std::int32_t>> out;
    for_cells([&](std::size_t s, std::size_t place) {
      for (const std::int32_t other : ranks_with(s, part_.cells[s][place]))
        for (int n = 0; n < made_.space.sets[s].nodes_per_cell; ++n)
          if (const std::int32_t node = nodes_of(s, place)[n]; node >= 0 && made_.is_own[at(node)] != 0)
            out[other].push_back(node);
    });
    Neighbours all;
    const std::size_t colours = made_.colours.size() - 1;
    std::vector<Neighbours> by_colour(colours);
    const auto add = [&](std::int32_t other, std::int32_t node, bool sends) {
      const auto colour = at(std::ranges::upper_bound(made_.colours, node) - made_.colours.begin() - 1);
      for (Neighbours* list : {&all, &by_colour[colour]}) {
        Halo::Neighbour::Items& items = items_for(*list, other, 1, 0);
        (sends ? items.send : items.receive).push_back(static_cast<Halo::Item>(node));
      }
    };
    for (auto& [other, nodes] : out) {
      std::ranges::sort(nodes);
      nodes.erase(std::ranges::unique(nodes).begin(), nodes.end());
      for (const std::int32_t node : nodes) add(other, node, true);
    }
    for (std::int32_t node = 0; node < made_.space.count; ++node)
      if (made_.is_own[at(node)] == 0) add(owner_of(node), node, false);
    made_.nodes = halo_of(std::move(all));
    for (Neighbours& list : by_colour) made_.by_colour.push_back(halo_of(std::move(list)));
  }

  const CoarseSpace& whole_;
  const ProblemPart& part_;
  const std::int32_t rank_;
  const std::vector<std::int32_t> owner_;  ///< By node of the whole space.
  std::vector<std::int32_t> free_;         ///< places_in_free() of the whole problem.
  CoarsePart made_;
};

}  // namespace

CoarsePart coarse_part(const CoarseSpace& whole, const std::vector<std::int32_t>& colours, const ProblemPart& part) {
  return CoarsePartMaker(whole, part).make(colours);
}

std::vector<std::int32_t> ranks_of_coarse_nodes(const CoarseSpace& whole, const ProblemPart& part) {
  const std::vector<std::int32_t> free = places_in_free(*part.whole);
  std::vector<std::int32_t> ranks = lowest_mesh_nodes(*part.whole, whole);
  for (std::int32_t& of_node : ranks) of_node = part.partition.rank_of_node(free[at(of_node)]);
  return ranks;
}

SparseRows rows_of(const SparseRows& rows, const std::vector<std::int32_t>& numbers) {
  SparseRows some;
  some.begin.push_back(0);
  for (const std::int32_t number : numbers) {
    const std::ptrdiff_t first = rows.begin[at(number)], last = rows.begin[at(number) + 1];
    some.column.insert(some.column.end(), rows.column.begin() + first, rows.column.begin() + last);
    some.factor.insert(some.factor.end(), rows.factor.begin() + first, rows.factor.begin() + last);
    some.begin.push_back(static_cast<std::int64_t>(some.column.size()));
  }
  return some;
}

}  // namespace varimesh
