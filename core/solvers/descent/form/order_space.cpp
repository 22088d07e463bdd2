#include "core/solvers/descent/form/order_space.h"

#include <algorithm>
#include <atomic>
#include <numeric>

#include "core/base/index.h"
#include "core/base/io/large_arrays.h"
#include "core/base/shared_work.h"
#include "core/mesh/changes/shared_nodes.h"
#include "core/solvers/descent/form/space_part.h"

namespace varimesh {
namespace {

constexpr std::size_t kNodesPerTask = 512;
constexpr std::int32_t kCellsPerTask = 64;
constexpr std::size_t kPlacesPerTask = 4096;

/// Calls body(set, place) for all places of the space; `place` is counted from the set's first one.
template <class Body>
void for_places(OrderSpace& space, const Team& team, const Body& body) {
  for (OrderSpace::Set& set : space.sets)
    team.for_ranges(set.numbers.size(), kPlacesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t place = begin; place < end; ++place) body(set, place);
    });
}

/// Numbers the places of all sets.
void count_places(OrderSpace& space) {
  for (OrderSpace::Set& set : space.sets) {
    set.first = space.place_count;
    space.place_count += static_cast<std::int64_t>(set.numbers.size());
    resize_large(set.is_first, set.numbers.size());
  }
}

/// Fills the lists that follow from the numbers. The threads list places in any order, so these are sorted then.
void list_places(OrderSpace& space, const Team& team) {
  space.begin.assign(at(space.count) + 1, 0);
  for_places(space, team, [&](OrderSpace::Set& set, std::size_t place) {
    if (set.numbers[place] >= 0) count_up(space.begin[at(set.numbers[place])], team);
    set.is_first[place] = 0;
  });
  space.places.resize(at(sums_before(space.begin)));
  std::vector<std::int64_t> next(space.begin.begin(), space.begin.end() - 1);
  for_places(space, team, [&](OrderSpace::Set& set, std::size_t place) {
    if (set.numbers[place] >= 0)
      space.places[at(count_up(next[at(set.numbers[place])], team))] = set.first + static_cast<std::int64_t>(place);
  });
  team.for_ranges(at(space.count), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node)
      std::sort(&space.places[at(space.begin[node])], space.places.data() + space.begin[node + 1]);
  });
}

void mark_first_places(OrderSpace& space, const Team& team) {
  for_places(space, team, [&](OrderSpace::Set& set, std::size_t place) {
    const std::int32_t number = set.numbers[place];
    if (number >= 0 && space.places[at(space.begin[at(number)])] == set.first + static_cast<std::int64_t>(place))
      set.is_first[place] = 1;
  });
}

/// By node: its rank among the free ones, −1 if it is fixed.
std::vector<std::int32_t> ranks(const Problem& problem, const Team& team) {
  std::vector<std::int32_t> rank(problem.positions.size() / at(problem.dimension), -1);
  team.for_ranges(problem.free.size(), kPlacesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) rank[at(problem.free[r])] = static_cast<std::int32_t>(r);
  });
  return rank;
}

/// Names each node of a lower order by a node of the problem that lies in the same vertex, edge, face or cell. All
/// cells with the node give it the same name, and no two nodes have the same one.
class StandIns {
 public:
  StandIns(Shape shape, int order, int lower, int dimension)
      : info_(reference::info(shape)),
        order_(order),
        lower_(lower),
        own_(detail::cell_nodes(shape, order, dimension)),
        low_(detail::cell_nodes(shape, lower, dimension)) {}

  /// @param nodes  those of a cell of the problem
  /// @param named  receives one for each node of the lower order
  void name(const std::int32_t* nodes, std::int32_t* named) const {
    std::copy_n(nodes, info_.vertices, named);
    for (std::size_t e = 0; e < low_.edges.size(); ++e) {
      const bool ascends = nodes[info_.edges[e][0]] < nodes[info_.edges[e][1]];
      for (const detail::PlacedNode& low : low_.edges[e])
        for (const detail::PlacedNode& own : own_.edges[e])
          if (own.i == (ascends ? low.i : order_ - lower_ + low.i)) named[low.local] = nodes[own.local];
    }
    for (std::size_t f = 0; f < low_.faces.size(); ++f) {
      if (low_.faces[f].empty()) continue;
      const detail::Vertices v = detail::face_vertices(info_.faces[f], nodes);
      for (const detail::PlacedNode& own : own_.faces[f]) {
        const std::int32_t rank = detail::face_place(v, own.i, own.j, order_).rank;
        for (const detail::PlacedNode& low : low_.faces[f])
          if (detail::face_place(v, low.i, low.j, lower_).rank == rank) named[low.local] = nodes[own.local];
      }
    }
    for (std::size_t i = 0; i < low_.interior.size(); ++i) named[low_.interior[i]] = nodes[own_.interior[i]];
  }

 private:
  const reference::ShapeInfo& info_;
  int order_, lower_;
  detail::CellNodes own_, low_;
};

}  // namespace

OrderSpace own_space(const Problem& problem, const Team& team, const ProblemPart* part) {
  OrderSpace space;
  space.count = space.own_count = static_cast<std::int32_t>(problem.free.size());
  const std::vector<std::int32_t> rank = ranks(problem, team);
  for (const CellSet& set : problem.sets) {
    space.order = set.order;
    OrderSpace::Set& added = space.sets.emplace_back();
    added.nodes_per_cell = set.nodes_per_cell;
    resize_large(added.numbers, set.nodes.size());
    team.for_ranges(set.nodes.size(), kPlacesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t place = begin; place < end; ++place) added.numbers[place] = rank[at(set.nodes[place])];
    });
  }
  count_places(space);
  for_places(space, team, [](OrderSpace::Set& set, std::size_t place) { set.is_first[place] = 0; });
  if (part != nullptr) {
    std::vector<std::int32_t> stand_ins(problem.free.size());
    std::iota(stand_ins.begin(), stand_ins.end(), 0);
    share_space(*part, stand_ins, space);
    return space;
  }
  team.for_ranges(problem.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) {
      const Incidence& first = problem.incidences[at(problem.offsets[r])];
      OrderSpace::Set& set = space.sets[at(first.set)];
      set.is_first[at(first.cell) * at(set.nodes_per_cell) + at(first.local)] = 1;
    }
  });
  return space;
}

OrderSpace lower_space(const Problem& problem, int order, const Team& team, const ProblemPart* part) {
  OrderSpace space;
  space.order = order;
  const std::vector<std::int32_t> rank = ranks(problem, team);
  std::vector<std::int32_t> numbers(problem.free.size(), 0);  // by the rank of the stand-in: 1 if there is a node
  for (std::size_t s = 0; s < problem.sets.size(); ++s) {
    const CellSet& set = problem.sets[s];
    OrderSpace::Set& added = space.sets.emplace_back();
    added.nodes_per_cell = reference::node_count(set.shape, order);
    const std::int32_t cells = part != nullptr ? part->share.places[s] : set.count;
    resize_large(added.numbers, at(cells) * at(added.nodes_per_cell));
    const StandIns stand_ins(set.shape, set.order, order, problem.dimension);
    team.for_each(cells, kCellsPerTask, [&](std::int32_t cell) {
      const std::span named(&added.numbers[at(cell) * at(added.nodes_per_cell)], at(added.nodes_per_cell));
      if (part != nullptr && part->cells[s][at(cell)] < 0) {
        std::ranges::fill(named, -1);
        return;
      }
      stand_ins.name(&set.nodes[at(cell) * at(set.nodes_per_cell)], named.data());
      for (std::int32_t& node : named) {
        node = rank[at(node)];
        if (node >= 0) std::atomic_ref(numbers[at(node)]).store(1, std::memory_order_relaxed);
      }
    });
  }
  std::vector<std::int32_t> stand_ins;  // by node
  for (std::size_t r = 0; part != nullptr && r < numbers.size(); ++r)
    if (numbers[r] != 0) stand_ins.push_back(static_cast<std::int32_t>(r));
  space.count = space.own_count = sums_before(numbers);
  for_places(space, team, [&](OrderSpace::Set& set, std::size_t place) {
    if (set.numbers[place] >= 0) set.numbers[place] = numbers[at(set.numbers[place])];
  });
  count_places(space);
  list_places(space, team);
  if (part != nullptr)
    share_space(*part, stand_ins, space);
  else
    mark_first_places(space, team);
  return space;
}

void gather(const OrderSpace::Set& set, Occurrence taken, std::int32_t first, std::int32_t count, int d,
            std::span<const double> vector, std::span<double> out) {
  const std::size_t nodes = at(set.nodes_per_cell);
  for (std::size_t lane = 0; lane < at(count); ++lane)
    for (std::size_t i = 0; i < nodes; ++i) {
      const std::size_t place = (at(first) + lane) * nodes + i;
      const std::int32_t number = taken == Occurrence::Every || set.is_first[place] != 0 ? set.numbers[place] : -1;
      for (std::size_t k = 0; k < at(d); ++k)
        out[(i * at(d) + k) * at(kCellsTogether) + lane] = number < 0 ? 0.0 : vector[at(number) * at(d) + k];
    }
}

void add_up(const Problem& problem, const OrderSpace& space, int d, std::span<double> contributions,
            std::span<double> out, const Team& team) {
  space.share.exchange(space.share.contributions, contributions, d);
  const auto add = [&](const std::vector<std::int64_t>& begin_of, const auto& place_of) {
    team.for_ranges(at(space.own_count), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t node = begin; node < end; ++node)
        for (int k = 0; k < d; ++k) {
          double sum = 0;
          for (std::int64_t i = begin_of[node]; i < begin_of[node + 1]; ++i)
            sum += contributions[at(place_of(at(i))) * at(d) + at(k)];
          out[node * at(d) + at(k)] = sum;
        }
    });
  };
  if (!space.begin.empty()) return add(space.begin, [&](std::size_t i) { return space.places[i]; });
  add(problem.offsets, [&](std::size_t i) {
    const Incidence& incidence = problem.incidences[i];
    const OrderSpace::Set& set = space.sets[at(incidence.set)];
    return set.first + std::int64_t{incidence.cell} * set.nodes_per_cell + incidence.local;
  });
}

}  // namespace varimesh
