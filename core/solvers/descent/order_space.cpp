#include "core/solvers/descent/order_space.h"

#include <algorithm>
#include <cassert>

#include "core/mesh/changes/change_order.h"
#include "core/mesh/connectivity.h"
#include "core/reference/nodes.h"

namespace varimesh {
namespace {

constexpr std::size_t kNodesPerTask = 512;

/// Fills everything that follows from the numbers.
void list_places(OrderSpace& space) {
  space.begin.assign(static_cast<std::size_t>(space.count) + 1, 0);
  for (OrderSpace::Set& set : space.sets) {
    set.first = space.place_count;
    space.place_count += static_cast<std::int64_t>(set.numbers.size());
    set.owned.assign(set.numbers.size(), -1);
    for (const std::int32_t number : set.numbers)
      if (number >= 0) ++space.begin[static_cast<std::size_t>(number) + 1];
  }
  for (std::size_t n = 0; n < static_cast<std::size_t>(space.count); ++n) space.begin[n + 1] += space.begin[n];
  space.places.resize(static_cast<std::size_t>(space.begin.back()));
  std::vector<std::int64_t> next(space.begin.begin(), space.begin.end() - 1);
  for (OrderSpace::Set& set : space.sets)
    for (std::size_t i = 0; i < set.numbers.size(); ++i) {
      const std::int32_t number = set.numbers[i];
      if (number < 0) continue;
      const auto n = static_cast<std::size_t>(number);
      if (next[n] == space.begin[n]) set.owned[i] = number;
      space.places[static_cast<std::size_t>(next[n]++)] = set.first + static_cast<std::int64_t>(i);
    }
}

/// By place of a cell of this shape, as reference::NodePlace: whether the nodes there are free.
class FreePlaces {
 public:
  FreePlaces(const CellSet& set, const std::vector<char>& free) : set_(set), free_(free) {}

  bool contains(std::int32_t cell, const reference::NodePlace& place) const {
    const auto& places = reference::node_places(set_.shape, set_.order);
    const std::int32_t* nodes = set_.nodes.data() + static_cast<std::size_t>(cell) * set_.nodes_per_cell;
    for (int i = 0; i < set_.nodes_per_cell; ++i)
      if (places[i].dimension == place.dimension && places[i].index == place.index) return free_[nodes[i]] != 0;
    assert(false && "a place of a lower order has nodes in the mesh's order too");
    return false;
  }

 private:
  const CellSet& set_;
  const std::vector<char>& free_;
};

}  // namespace

OrderSpace own_space(const Problem& problem) {
  OrderSpace space;
  space.count = static_cast<std::int32_t>(problem.free.size());
  std::vector<std::int32_t> number(problem.positions.size() / problem.dimension, -1);
  for (std::int32_t rank = 0; rank < space.count; ++rank) number[problem.free[rank]] = rank;
  for (const CellSet& set : problem.sets) {
    space.order = set.order;
    OrderSpace::Set& added = space.sets.emplace_back();
    added.nodes_per_cell = set.nodes_per_cell;
    added.numbers.reserve(set.nodes.size());
    for (const std::int32_t node : set.nodes) added.numbers.push_back(number[node]);
  }
  list_places(space);
  return space;
}

OrderSpace lower_space(const Problem& problem, const HighOrderMesh& mesh, int order) {
  const Expected<HighOrderMesh> lowered = change_order(mesh, order);
  assert(lowered && "a mesh that was checked has every order");
  const Cells cells(*lowered, lowered->dimension);
  std::vector<char> free(problem.positions.size() / problem.dimension, 0);
  for (const std::int32_t node : problem.free) free[node] = 1;
  OrderSpace space;
  space.order = order;
  std::vector<std::int32_t> number(lowered->node_count(), -1);
  for (const CellSet& set : problem.sets) {
    OrderSpace::Set& added = space.sets.emplace_back();
    added.nodes_per_cell = reference::node_count(set.shape, order);
    added.numbers.reserve(static_cast<std::size_t>(set.count) * added.nodes_per_cell);
    const auto& places = reference::node_places(set.shape, order);
    const FreePlaces free_places(set, free);
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      const std::span<const std::int32_t> nodes = cells.nodes(set.mesh_cell[cell]);
      for (int i = 0; i < added.nodes_per_cell; ++i) {
        std::int32_t& of_node = number[nodes[i]];
        if (of_node < 0 && free_places.contains(cell, places[i])) of_node = space.count++;
        added.numbers.push_back(of_node);
      }
    }
  }
  list_places(space);
  return space;
}

void gather(const std::vector<std::int32_t>& numbers, int nodes_per_cell, std::int32_t first, std::int32_t count, int d,
            std::span<const double> vector, Eigen::MatrixXd& out) {
  out.resize(nodes_per_cell, static_cast<Eigen::Index>(count) * d);
  for (std::int32_t cell = 0; cell < count; ++cell) {
    const std::int32_t* of_cell = numbers.data() + static_cast<std::size_t>(first + cell) * nodes_per_cell;
    for (int i = 0; i < nodes_per_cell; ++i)
      for (int k = 0; k < d; ++k)
        out(i, static_cast<Eigen::Index>(cell) * d + k) =
            of_cell[i] < 0 ? 0.0 : vector[static_cast<std::size_t>(of_cell[i]) * d + k];
  }
}

void add_up(const OrderSpace& space, int d, std::span<const double> contributions, std::span<double> out,
            const Team& team) {
  team.for_ranges(static_cast<std::size_t>(space.count), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node)
      for (int k = 0; k < d; ++k) {
        double sum = 0;
        for (std::int64_t i = space.begin[node]; i < space.begin[node + 1]; ++i)
          sum += contributions[static_cast<std::size_t>(space.places[i]) * d + k];
        out[node * d + k] = sum;
      }
  });
}

}  // namespace varimesh
