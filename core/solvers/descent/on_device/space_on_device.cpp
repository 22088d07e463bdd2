#include "core/solvers/descent/on_device/space_on_device.h"

#include <algorithm>

#include "core/base/index.h"
#include "core/kernels/hessian/batches.h"

namespace varimesh {
namespace {

constexpr std::size_t kPlacesPerTask = 16384;

int place_of(std::span<const std::size_t> places, int node) {
  return places.empty() ? node : static_cast<int>(places[at(node)]);
}

/// Where the contribution of a node of a cell is.
std::int64_t contribution_of(const SpaceOnDevice::Set& set, std::int32_t cell, int place) {
  return set.first +
         static_cast<std::int64_t>(contribution_index(cell, place, static_cast<std::uint32_t>(set.places), 1));
}

/// What the set says of its places. Lanes past the last cell have fixed nodes only.
std::vector<std::int32_t> numbers_of(const OrderSpace::Set& from, const SpaceOnDevice::Set& set,
                                     std::span<const std::size_t> places, const Team& team) {
  std::vector<std::int32_t> numbers(at(set.batches) * at(set.places) * at(kBatch), device::kFixedNode);
  const std::size_t nodes = at(set.places);
  team.for_ranges(from.numbers.size(), kPlacesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (from.numbers[i] < 0) continue;
      const auto cell = static_cast<std::int32_t>(i / nodes);
      const std::size_t to =
          contribution_index(cell, place_of(places, static_cast<int>(i % nodes)), static_cast<std::uint32_t>(nodes), 1);
      numbers[to] = from.is_first[i] != 0 ? from.numbers[i] : device::later_place(from.numbers[i]);
    }
  });
  return numbers;
}

}  // namespace

SpaceOnDevice copy_space(device::Queue& queue, const Problem& problem, const OrderSpace& space,
                         const PlacesOfNodes& places, const Team& team) {
  SpaceOnDevice copied;
  copied.count = space.count;
  std::int64_t first = 0;
  for (std::size_t s = 0; s < space.sets.size(); ++s) {
    SpaceOnDevice::Set& set = copied.sets.emplace_back();
    set.batches = (problem.sets[s].count + kBatch - 1) / kBatch;
    set.places = space.sets[s].nodes_per_cell;
    set.first = first;
    first += std::int64_t{kBatch} * set.batches * set.places;
    queue.fill(set.numbers, numbers_of(space.sets[s], set, places[s], team));
  }
  const auto where = [&](std::size_t s, std::int32_t cell, int node) {
    return contribution_of(copied.sets[s], cell, place_of(places[s], node));
  };
  const auto where_incidence = [&](std::size_t i) {
    const Incidence& in = problem.incidences[i];
    return where(at(in.set), in.cell, in.local);
  };
  const auto where_place = [&](std::size_t i) {
    const std::int64_t place = space.places[i];
    std::size_t s = space.sets.size() - 1;
    while (place < space.sets[s].first) --s;
    const std::int64_t in_set = place - space.sets[s].first, nodes = space.sets[s].nodes_per_cell;
    return where(s, static_cast<std::int32_t>(in_set / nodes), static_cast<int>(in_set % nodes));
  };
  const bool is_own = space.begin.empty();
  std::vector<std::int64_t> list(is_own ? problem.incidences.size() : space.places.size());
  team.for_ranges(list.size(), kPlacesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) list[i] = is_own ? where_incidence(i) : where_place(i);
  });
  queue.fill(copied.begin, is_own ? problem.offsets : space.begin);
  queue.fill(copied.places, list);
  return copied;
}

device::OrderArguments SpaceOnDevice::arguments(const double* contributions) const {
  device::OrderArguments a;
  a.nodes = count;
  a.begin = begin.as<const std::int64_t>();
  a.places = places.as<const std::int64_t>();
  a.contributions = contributions;
  return a;
}

std::size_t SpaceOnDevice::memory() const {
  std::size_t bytes = begin.bytes() + places.bytes();
  for (const Set& set : sets) bytes += set.numbers.bytes();
  return bytes;
}

}  // namespace varimesh
