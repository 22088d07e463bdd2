#include "core/terms/part/problem_part.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <span>
#include <utility>

#include "core/kernels/hessian/batches.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNone = -1;
constexpr std::size_t kNodesPerExchange = 1 << 16;  // whose positions go to all ranks at a time

/// Copies `width` numbers of each cell from the arrays of the whole set to those of the part.
template <class Array>
void pick(const Array& whole, std::size_t width, const std::vector<std::int32_t>& cells, Array& part) {
  if (whole.empty()) return;
  part.resize(cells.size() * width);
  for (std::size_t place = 0; place < cells.size(); ++place)
    if (cells[place] != kNone) std::copy_n(whole.data() + at(cells[place]) * width, width, part.data() + place * width);
}

/// The tables of a set, without cells.
CellSet tables_of(const CellSet& whole) {
  CellSet set;
  set.shape = whole.shape;
  set.dimension = whole.dimension;
  set.order = whole.order;
  set.nodes_per_cell = whole.nodes_per_cell;
  set.degree = whole.degree;
  set.points = whole.points;
  set.stride = whole.stride;
  set.affine = whole.affine;
  set.derivatives = whole.derivatives;
  set.weights = whole.weights;
  return set;
}

/// The work of part_of().
class PartMaker {
 public:
  PartMaker(const Problem& whole, const Partition& partition, const Ranks& ranks)
      : whole_(whole), partition_(partition), ranks_(ranks), rank_(ranks.rank()) {}

  ProblemPart make() {
    number_ = places_in_free(whole_);
    choose_cells();
    choose_nodes();
    copy_sets();
    list_incidences();
    list_contributions();
    list_nodes();
    part_.share.ranks = &ranks_;
    part_.share.free_nodes = static_cast<std::int64_t>(whole_.free.size());
    return std::move(part_);
  }

 private:
  bool is_own(std::int32_t number) const { return number != kNone && partition_.rank_of_node(number) == rank_; }
  std::span<const std::int32_t> nodes_of(std::size_t set, std::int32_t cell) const {
    const CellSet& cells = whole_.sets[set];
    return {cells.nodes.data() + at(cell) * at(cells.nodes_per_cell), at(cells.nodes_per_cell)};
  }

  /// The rank's own cells and then its ghosts, by set.
  void choose_cells() {
    std::vector<std::vector<std::int32_t>> ghosts(whole_.sets.size());
    for (std::size_t f = 0; f < whole_.free.size(); ++f) {
      if (!is_own(static_cast<std::int32_t>(f))) continue;
      for (std::int64_t i = whole_.offsets[f]; i < whole_.offsets[f + 1]; ++i) {
        const Incidence& in = whole_.incidences[at(i)];
        if (partition_.rank_of_cell(at(in.set), in.cell) != rank_) ghosts[at(in.set)].push_back(in.cell);
      }
    }
    for (std::size_t s = 0; s < whole_.sets.size(); ++s) {
      std::vector<std::int32_t>& cells = part_.cells.emplace_back();
      for (std::int32_t cell = 0; cell < whole_.sets[s].count; ++cell)
        if (partition_.rank_of_cell(s, cell) == rank_) cells.push_back(cell);
      own_cells_.push_back(static_cast<std::int32_t>(cells.size()));
      std::ranges::sort(ghosts[s]);
      ghosts[s].erase(std::ranges::unique(ghosts[s]).begin(), ghosts[s].end());
      if (!ghosts[s].empty()) cells.resize((cells.size() + kBatch - 1) / kBatch * kBatch, kNone);
      cells.insert(cells.end(), ghosts[s].begin(), ghosts[s].end());
      part_.share.places.push_back(static_cast<std::int32_t>(cells.size()));
    }
  }

  /// Calls use(set, place, cell) for the rank's own cells, or for its ghosts, in order.
  template <class Use>
  void for_cells(bool ghosts, const Use& use) const {
    for (std::size_t s = 0; s < part_.cells.size(); ++s) {
      const std::vector<std::int32_t>& cells = part_.cells[s];
      for (std::size_t place = ghosts ? at(own_cells_[s]) : 0; place < (ghosts ? cells.size() : at(own_cells_[s]));
           ++place)
        if (cells[place] != kNone) use(s, static_cast<std::int32_t>(place), cells[place]);
    }
  }

  void choose_nodes() {
    const std::size_t d = at(whole_.dimension);
    std::vector<char> is_here(number_.size()), is_near(whole_.free.size());
    for (const bool ghosts : {false, true})
      for_cells(ghosts, [&](std::size_t s, std::int32_t, std::int32_t cell) {
        for (const std::int32_t node : nodes_of(s, cell)) {
          is_here[at(node)] = 1;
          if (!ghosts && number_[at(node)] != kNone) is_near[at(number_[at(node)])] = 1;
        }
      });
    local_.assign(number_.size(), kNone);
    for (std::size_t node = 0; node < number_.size(); ++node) {
      if (is_here[node] == 0) continue;
      local_[node] = static_cast<std::int32_t>(part_.nodes.size());
      part_.nodes.push_back(static_cast<std::int32_t>(node));
      const auto from = whole_.positions.begin() + static_cast<std::ptrdiff_t>(node * d);
      part_.problem.positions.insert(part_.problem.positions.end(), from, from + static_cast<std::ptrdiff_t>(d));
    }
    std::vector<std::int32_t>& numbers = part_.share.numbers;
    for (const bool own : {true, false}) {
      for (std::size_t f = 0; f < whole_.free.size(); ++f)
        if (is_own(static_cast<std::int32_t>(f)) == own && (own || is_near[f] != 0))
          numbers.push_back(static_cast<std::int32_t>(f));
      if (own) part_.share.own_nodes = static_cast<std::int32_t>(numbers.size());
    }
    place_.assign(whole_.free.size(), kNone);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      place_[at(numbers[i])] = static_cast<std::int32_t>(i);
      part_.problem.free.push_back(local_[at(whole_.free[at(numbers[i])])]);
      if (!whole_.inverse_size.empty()) part_.problem.inverse_size.push_back(whole_.inverse_size[at(numbers[i])]);
    }
  }

  void copy_sets() {
    Problem& problem = part_.problem;
    problem.dimension = whole_.dimension;
    problem.clusters = whole_.clusters;
    for (std::size_t s = 0; s < whole_.sets.size(); ++s) {
      const CellSet& from = whole_.sets[s];
      const std::vector<std::int32_t>& cells = part_.cells[s];
      CellSet& set = problem.sets.emplace_back(tables_of(from));
      set.count = own_cells_[s];
      set.first = problem.cells;
      problem.cells += set.count;
      const std::size_t square = at(set.dimension) * at(set.dimension), per_target = set.affine ? 1 : at(set.stride);
      pick(from.mesh_cell, 1, cells, set.mesh_cell);
      pick(from.nodes, at(set.nodes_per_cell), cells, set.nodes);
      pick(from.inverse_target, square * per_target, cells, set.inverse_target);
      pick(from.measure, per_target, cells, set.measure);
      pick(from.uniform_target, square + 1, cells, set.uniform_target);
      pick(from.left_factor, square, cells, set.left_factor);
      pick(from.delta_squared, 1, cells, set.delta_squared);
      pick(from.unrepairable, 1, cells, set.unrepairable);
      for (std::size_t i = 0; i < set.nodes.size(); ++i)
        if (cells[i / at(set.nodes_per_cell)] != kNone) set.nodes[i] = local_[at(set.nodes[i])];
      for (std::int32_t cell = 0; cell < set.count; ++cell) {
        problem.cluster.push_back(whole_.cluster[at(from.first + cells[at(cell)])]);
        if (!whole_.cell_size.empty()) problem.cell_size.push_back(whole_.cell_size[at(from.first + cells[at(cell)])]);
      }
    }
  }

  void list_incidences() {
    std::vector<std::vector<std::int32_t>> place(whole_.sets.size());  // by cell of the whole problem
    for (std::size_t s = 0; s < place.size(); ++s) place[s].assign(at(whole_.sets[s].count), kNone);
    for (const bool ghosts : {false, true})
      for_cells(ghosts, [&](std::size_t s, std::int32_t to, std::int32_t cell) { place[s][at(cell)] = to; });
    Problem& problem = part_.problem;
    problem.offsets.push_back(0);
    for (std::size_t f = 0; f < problem.free.size(); ++f) {
      const std::size_t number = at(part_.share.numbers[f]);
      if (f < at(part_.share.own_nodes))
        for (std::int64_t i = whole_.offsets[number]; i < whole_.offsets[number + 1]; ++i) {
          const Incidence& in = whole_.incidences[at(i)];
          problem.incidences.push_back({place[at(in.set)][at(in.cell)], in.set, in.local});
        }
      problem.offsets.push_back(static_cast<std::int64_t>(problem.incidences.size()));
    }
  }

  // ===== Halos: both ends go through the same cells and nodes in the same order =====

  static Halo::Neighbour& neighbour(std::map<std::int32_t, Halo::Neighbour>& all, std::int32_t rank,
                                    std::size_t arrays) {
    Halo::Neighbour& found = all[rank];
    found.rank = rank;
    found.arrays.resize(arrays);
    return found;
  }
  static Halo halo_of(std::map<std::int32_t, Halo::Neighbour>& all) {
    std::vector<Halo::Neighbour> neighbours;
    for (auto& [_, one] : all) neighbours.push_back(std::move(one));
    return Halo(std::move(neighbours));
  }

  void list_contributions() {
    std::map<std::int32_t, Halo::Neighbour> all, cells;
    for (const bool ghosts : {false, true})
      for_cells(ghosts, [&](std::size_t s, std::int32_t place, std::int32_t cell) {
        const auto nodes = nodes_of(s, cell);
        const auto add_cell = [&](std::int32_t other) {
          Halo::Neighbour::Items& items = neighbour(cells, other, whole_.sets.size()).arrays[s];
          std::vector<Halo::Item>& list = ghosts ? items.receive : items.send;
          if (list.empty() || list.back() != at(place)) list.push_back(static_cast<Halo::Item>(place));
        };
        for (std::size_t n = 0; n < nodes.size(); ++n) {
          const std::int32_t number = number_[at(nodes[n])];
          if (number == kNone || is_own(number) != ghosts) continue;
          const std::int32_t other = ghosts ? partition_.rank_of_cell(s, cell) : partition_.rank_of_node(number);
          add_cell(other);
          Halo::Neighbour::Items& items = neighbour(all, other, whole_.sets.size()).arrays[s];
          const std::size_t item =
              contribution_index(place, static_cast<int>(n), static_cast<std::uint32_t>(nodes.size()), 1);
          (ghosts ? items.receive : items.send).push_back(static_cast<Halo::Item>(item));
        }
      });
    part_.share.contributions = halo_of(all);
    part_.share.cells = halo_of(cells);
  }

  void list_nodes() {
    // By other rank: the numbers of the free nodes that are sent and received.
    std::map<std::int32_t, std::vector<std::int32_t>> near_out, near_in, out, in;
    for (const bool ghosts : {false, true})
      for_cells(ghosts, [&](std::size_t s, std::int32_t, std::int32_t cell) {
        const std::int32_t worker = partition_.rank_of_cell(s, cell);
        for (const std::int32_t node : nodes_of(s, cell)) {
          const std::int32_t number = number_[at(node)];
          if (number == kNone) continue;
          const std::int32_t owner = partition_.rank_of_node(number);
          if (owner != rank_) {
            in[owner].push_back(number);
            if (!ghosts) near_in[owner].push_back(number);
            continue;
          }
          if (ghosts) near_out[worker].push_back(number);
          if (ghosts) out[worker].push_back(number);
          for (const std::int32_t beside : nodes_of(s, cell))
            if (number_[at(beside)] != kNone && !is_own(number_[at(beside)]))
              out[partition_.rank_of_node(number_[at(beside)])].push_back(number);
        }
      });
    part_.share.directions = halo_of(near_out, near_in, [&](std::int32_t number) { return place_[at(number)]; });
    part_.share.positions = halo_of(out, in, [&](std::int32_t number) { return local_[at(whole_.free[at(number)])]; });
  }

  template <class ItemOf>
  static Halo halo_of(std::map<std::int32_t, std::vector<std::int32_t>>& out,
                      std::map<std::int32_t, std::vector<std::int32_t>>& in, const ItemOf& item_of) {
    std::map<std::int32_t, Halo::Neighbour> all;
    for (const bool sends : {true, false})
      for (auto& [rank, numbers] : sends ? out : in) {
        std::ranges::sort(numbers);
        numbers.erase(std::ranges::unique(numbers).begin(), numbers.end());
        Halo::Neighbour::Items& items = neighbour(all, rank, 1).arrays.front();
        for (const std::int32_t number : numbers)
          (sends ? items.send : items.receive).push_back(static_cast<Halo::Item>(item_of(number)));
      }
    return halo_of(all);
  }

  const Problem& whole_;
  const Partition& partition_;
  const Ranks& ranks_;
  const std::int32_t rank_;
  std::vector<std::int32_t> number_;  ///< places_in_free() of the whole problem.
  std::vector<std::int32_t> local_;   ///< By node of the whole problem: the node of the part.
  std::vector<std::int32_t> place_;   ///< By free node of the whole problem: its place in the part's `free`.
  std::vector<std::int32_t> own_cells_;
  ProblemPart part_;
};

/// Calls use(item, place) for all items in their order. `place` is that in the list which has the items of the first
/// rank, then those of the next, and so on, as gather_everywhere() returns them.
template <class RankOf, class Use>
void for_items_by_rank(int ranks, std::size_t count, const RankOf& rank_of, const Use& use) {
  std::vector<std::size_t> next(at(ranks) + 1, 0);
  for (std::size_t item = 0; item < count; ++item) ++next[at(rank_of(item)) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  for (std::size_t item = 0; item < count; ++item) use(item, next[at(rank_of(item))]++);
}

/// The same for the free nodes of the whole problem.
template <class Use>
void for_free_by_rank(const ProblemPart& part, const Use& use) {
  const auto rank_of = [&](std::size_t free) { return part.partition.rank_of_node(static_cast<std::int32_t>(free)); };
  for_items_by_rank(part.partition.ranks, part.whole->free.size(), rank_of, use);
}

std::ptrdiff_t own_end(const ProblemPart& part) {
  return static_cast<std::ptrdiff_t>(at(part.share.own_nodes) * at(part.problem.dimension));
}

}  // namespace

std::vector<std::int32_t> places_in_free(const Problem& problem) {
  std::vector<std::int32_t> places(problem.positions.size() / at(problem.dimension), kNone);
  for (std::size_t f = 0; f < problem.free.size(); ++f) places[at(problem.free[f])] = static_cast<std::int32_t>(f);
  return places;
}

ProblemPart part_of(const Problem& whole, const Ranks& ranks) {
  const Partition division = partition(whole, ranks.count());
  ProblemPart part = PartMaker(whole, division, ranks).make();
  part.whole = &whole;
  part.partition = division;
  return part;
}

void ProblemPart::follow() {
  const std::size_t d = at(problem.dimension);
  for (std::size_t node = 0; node < nodes.size(); ++node)
    std::copy_n(whole->positions.data() + at(nodes[node]) * d, d, problem.positions.data() + node * d);
  for (std::size_t s = 0; s < problem.sets.size(); ++s)
    pick(whole->sets[s].delta_squared, 1, cells[s], problem.sets[s].delta_squared);
}

std::vector<double> gather_free(const ProblemPart& part, std::span<const double> mine) {
  const std::size_t d = at(part.problem.dimension);
  const auto all = part.share.ranks->gather_everywhere(std::vector<double>(mine.begin(), mine.begin() + own_end(part)));
  std::vector<double> whole(all.size());
  for_free_by_rank(part, [&](std::size_t free, std::size_t place) {
    std::copy_n(all.data() + place * d, d, whole.data() + free * d);
  });
  return whole;
}

std::vector<float> gather_set(const ProblemPart& part, std::size_t set, std::span<const float> mine,
                              std::size_t width) {
  const auto end = mine.begin() + static_cast<std::ptrdiff_t>(at(part.problem.sets[set].count) * width);
  const auto all = part.share.ranks->gather_everywhere(std::vector<float>(mine.begin(), end));
  std::vector<float> whole(all.size());
  const auto rank_of = [&](std::size_t cell) {
    return part.partition.rank_of_cell(set, static_cast<std::int32_t>(cell));
  };
  for_items_by_rank(part.partition.ranks, at(part.whole->sets[set].count), rank_of,
                    [&](std::size_t cell, std::size_t place) {
                      std::copy_n(all.data() + place * width, width, whole.data() + cell * width);
                    });
  return whole;
}

std::vector<std::int32_t> cells_by_rank(const ProblemPart& part) {
  std::vector<std::int32_t> ranks, numbers(at(part.whole->cells));
  for (std::size_t s = 0; s < part.whole->sets.size(); ++s)
    for (std::int32_t cell = 0; cell < part.whole->sets[s].count; ++cell)
      ranks.push_back(part.partition.rank_of_cell(s, cell));
  for_items_by_rank(
      part.partition.ranks, numbers.size(), [&](std::size_t cell) { return ranks[cell]; },
      [&](std::size_t cell, std::size_t place) { numbers[place] = static_cast<std::int32_t>(cell); });
  return numbers;
}

void take_of_set(const ProblemPart& part, std::size_t set, std::span<const float> whole, std::size_t width,
                 std::span<float> mine) {
  const std::vector<std::int32_t>& cells = part.cells[set];
  for (std::size_t place = 0; place < cells.size(); ++place)
    if (cells[place] != kNone) std::copy_n(whole.data() + at(cells[place]) * width, width, mine.data() + place * width);
}

void gather_positions(const ProblemPart& part, std::vector<double>& whole) {
  const std::size_t d = at(part.problem.dimension), free_nodes = part.whole->free.size();
  std::size_t own = 0;
  // In pieces, because a list of all positions would be one of the largest arrays of a run.
  for (std::size_t first = 0, last = 0; first < free_nodes; first = last) {
    last = std::min(first + kNodesPerExchange, free_nodes);
    std::vector<double> mine;
    for (; own < at(part.share.own_nodes) && at(part.share.numbers[own]) < last; ++own) {
      const double* from = part.problem.positions.data() + at(part.problem.free[own]) * d;
      mine.insert(mine.end(), from, from + d);
    }
    const std::vector<double> all = part.share.ranks->gather_everywhere(mine);
    const auto rank_of = [&](std::size_t i) {
      return part.partition.rank_of_node(static_cast<std::int32_t>(first + i));
    };
    for_items_by_rank(part.partition.ranks, last - first, rank_of, [&](std::size_t i, std::size_t place) {
      std::copy_n(all.data() + place * d, d, whole.data() + at(part.whole->free[first + i]) * d);
    });
  }
}

}  // namespace varimesh
