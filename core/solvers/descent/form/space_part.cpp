#include "core/solvers/descent/form/space_part.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "core/base/index.h"

namespace varimesh {
namespace {

/// The work of share_space().
class SpaceSharer {
 public:
  SpaceSharer(const ProblemPart& part, std::span<const std::int32_t> stand_ins, OrderSpace& space)
      : part_(part), stand_ins_(stand_ins), space_(space), rank_(part.share.ranks->rank()) {}

  void share() {
    space_.own_count =
        static_cast<std::int32_t>(std::ranges::lower_bound(stand_ins_, part_.share.own_nodes) - stand_ins_.begin());
    space_.share.ranks = part_.share.ranks;
    put_places_in_order();
    list_firsts();
    list_values_and_contributions();
  }

 private:
  using Lists = std::map<std::int32_t, Halo::Neighbour::Items>;  // by other rank

  std::int32_t whole_number(std::int32_t node) const { return part_.share.numbers[at(stand_ins_[at(node)])]; }
  std::int32_t owner(std::int32_t node) const { return part_.partition.rank_of_node(whole_number(node)); }
  bool is_own(std::int32_t node) const { return node < space_.own_count; }
  std::int32_t worker(std::size_t set, std::int32_t cell) const {
    return part_.partition.rank_of_cell(set, part_.cells[set][at(cell)]);
  }

  static Halo halo_of(const Lists& lists) {
    std::vector<Halo::Neighbour> neighbours;
    for (const auto& [rank, items] : lists) neighbours.push_back({rank, {items}});
    return Halo(std::move(neighbours));
  }

  /// Calls use(set, cell, place, node) for the free nodes of the rank's own cells, or of its ghosts. Each rank goes
  /// through the same cells and nodes in the same order.
  template <class Use>
  void for_places(bool ghosts, const Use& use) const {
    for (std::size_t s = 0; s < space_.sets.size(); ++s) {
      const OrderSpace::Set& set = space_.sets[s];
      const std::int32_t own = part_.problem.sets[s].count, all = part_.share.places[s];
      for (std::int32_t cell = ghosts ? own : 0; cell < (ghosts ? all : own); ++cell) {
        if (part_.cells[s][at(cell)] < 0) continue;
        for (std::int64_t i = 0; i < set.nodes_per_cell; ++i) {
          const std::int64_t place = std::int64_t{cell} * set.nodes_per_cell + i;
          if (set.numbers[at(place)] >= 0) use(s, cell, set.first + place, set.numbers[at(place)]);
        }
      }
    }
  }

  /// The place's cell among all cells of the whole problem, and its node there.
  std::pair<std::int32_t, std::int64_t> in_whole(std::int64_t place) const {
    std::size_t s = space_.sets.size() - 1;
    while (place < space_.sets[s].first) --s;
    const std::int64_t of_set = place - space_.sets[s].first, nodes = space_.sets[s].nodes_per_cell;
    return {part_.whole->sets[s].first + part_.cells[s][at(of_set / nodes)], of_set % nodes};
  }

  /// Ghosts come after the rank's own cells, wherever they are in the whole problem.
  void put_places_in_order() {
    if (space_.begin.empty()) return;
    std::vector<char> has_ghosts(at(space_.own_count));
    for_places(true, [&](std::size_t, std::int32_t, std::int64_t, std::int32_t node) {
      if (is_own(node)) has_ghosts[at(node)] = 1;
    });
    for (std::size_t node = 0; node < has_ghosts.size(); ++node)
      if (has_ghosts[node] != 0)
        std::sort(&space_.places[at(space_.begin[node])], space_.places.data() + space_.begin[node + 1],
                  [&](std::int64_t a, std::int64_t b) { return in_whole(a) < in_whole(b); });
  }

  void list_firsts() {
    const Problem& whole = *part_.whole;
    Lists to, from;
    for (std::int32_t node = 0; node < space_.count; ++node) {
      const Incidence& first = whole.incidences[at(whole.offsets[at(whole_number(node))])];
      const std::int32_t works = part_.partition.rank_of_cell(at(first.set), first.cell);
      if (works == rank_) mark_first(at(first.set), first.cell, node);
      const auto item = static_cast<Halo::Item>(node);
      if (is_own(node) && works != rank_) {
        to[works].send.push_back(item);
        from[works].receive.push_back(item);
      } else if (!is_own(node) && works == rank_) {
        to[owner(node)].receive.push_back(item);
        from[owner(node)].send.push_back(item);
      }
    }
    space_.share.to_first = halo_of(to);
    space_.share.from_first = halo_of(from);
  }

  /// `cell`: a number in the set of the whole problem, of one of the rank's own cells.
  void mark_first(std::size_t s, std::int32_t cell, std::int32_t node) {
    OrderSpace::Set& set = space_.sets[s];
    const std::span own = std::span(part_.cells[s]).first(at(part_.problem.sets[s].count));
    const auto place = (std::ranges::lower_bound(own, cell) - own.begin()) * set.nodes_per_cell;
    const auto nodes = std::span(set.numbers).subspan(at(place), at(set.nodes_per_cell));
    set.is_first[at(place + (std::ranges::find(nodes, node) - nodes.begin()))] = 1;
  }

  void list_values_and_contributions() {
    Lists values, contributions;
    for (std::int32_t node = space_.own_count; node < space_.count; ++node)
      values[owner(node)].receive.push_back(static_cast<Halo::Item>(node));
    for_places(false, [&](std::size_t, std::int32_t, std::int64_t place, std::int32_t node) {
      if (!is_own(node)) contributions[owner(node)].send.push_back(static_cast<Halo::Item>(place));
    });
    for_places(true, [&](std::size_t s, std::int32_t cell, std::int64_t place, std::int32_t node) {
      if (!is_own(node)) return;
      values[worker(s, cell)].send.push_back(static_cast<Halo::Item>(node));
      contributions[worker(s, cell)].receive.push_back(static_cast<Halo::Item>(place));
    });
    for (auto& [rank, items] : values) {
      std::ranges::sort(items.send);
      items.send.erase(std::ranges::unique(items.send).begin(), items.send.end());
    }
    space_.share.values = halo_of(values);
    space_.share.contributions = halo_of(contributions);
  }

  const ProblemPart& part_;
  std::span<const std::int32_t> stand_ins_;
  OrderSpace& space_;
  const std::int32_t rank_;
};

}  // namespace

void share_space(const ProblemPart& part, std::span<const std::int32_t> stand_ins, OrderSpace& space) {
  SpaceSharer(part, stand_ins, space).share();
}

}  // namespace varimesh
