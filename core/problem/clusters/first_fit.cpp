#include "core/problem/clusters/first_fit.h"

#include <numeric>

#include "core/base/random/hash.h"

namespace varimesh {
namespace {

constexpr std::size_t kItemsPerChunk = 8192;

}  // namespace

std::vector<std::int32_t> chunks_in_turn(std::int32_t chunks) {
  std::vector<std::int32_t> order(at(chunks));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [](std::int32_t chunk) { return hash(static_cast<std::uint32_t>(chunk)); });
  return order;
}

Rounds rounds_of(std::int32_t chunks, const std::vector<std::pair<std::int32_t, std::int32_t>>& neighbours) {
  const std::vector<std::int32_t> order = chunks_in_turn(chunks);
  std::vector<std::int32_t> turn(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) turn[at(order[i])] = static_cast<std::int32_t>(i);
  std::vector<std::pair<std::int32_t, std::int32_t>> later_first(neighbours.size());
  std::ranges::transform(neighbours, later_first.begin(), [&](const auto& pair) {
    const auto [earlier, later] = std::minmax(turn[at(pair.first)], turn[at(pair.second)]);
    return std::pair(later, earlier);
  });
  std::ranges::sort(later_first);
  std::vector<std::int32_t> round(order.size(), 0);  // by turn
  std::int32_t rounds = chunks > 0 ? 1 : 0;
  for (const auto& [later, earlier] : later_first) {
    round[at(later)] = std::max(round[at(later)], round[at(earlier)] + 1);
    rounds = std::max(rounds, round[at(later)] + 1);
  }
  Rounds result;
  result.begin.assign(at(rounds) + 1, 0);
  for (const std::int32_t r : round) ++result.begin[at(r)];
  sums_before(result.begin);
  result.chunks.resize(order.size());
  std::vector<std::int32_t> next = result.begin;
  for (std::size_t i = 0; i < order.size(); ++i) result.chunks[at(next[at(round[i])]++)] = order[i];
  return result;
}

ColourPlaces sort_by_colour(const std::vector<std::int32_t>& colour_of, const Team& team) {
  const std::size_t chunks = chunks_of(colour_of.size(), kItemsPerChunk);
  std::vector<std::vector<std::int32_t>> next(chunks);  // by chunk and colour: how many items, then their places
  for_chunks(team, colour_of.size(), kItemsPerChunk, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::vector<std::int32_t>& counts = next[chunk];
    for (std::size_t item = begin; item < end; ++item) {
      if (at(colour_of[item]) >= counts.size()) counts.resize(at(colour_of[item]) + 1, 0);
      ++counts[at(colour_of[item])];
    }
  });
  std::size_t colours = 0;
  for (const std::vector<std::int32_t>& counts : next) colours = std::max(colours, counts.size());
  ColourPlaces places;
  std::int32_t sum = 0;
  for (std::size_t colour = 0; colour < colours; ++colour) {
    places.begin.push_back(sum);
    for (std::vector<std::int32_t>& counts : next)
      if (colour < counts.size()) sum += std::exchange(counts[colour], sum);
  }
  places.begin.push_back(sum);
  places.place.resize(colour_of.size());
  for_chunks(team, colour_of.size(), kItemsPerChunk, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t item = begin; item < end; ++item) places.place[item] = next[chunk][at(colour_of[item])]++;
  });
  return places;
}

}  // namespace varimesh
