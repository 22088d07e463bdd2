// Items with a common cell get different colours, the first that is free, with any number of threads.
#include "core/problem/clusters/first_fit.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <set>

namespace varimesh {
namespace {

constexpr int kThreads[] = {1, 2, 3, 16};

/// Which items touch which cells.
struct Touching {
  std::vector<std::vector<std::int32_t>> cells_of, items_of;

  Touching(std::size_t items, std::size_t cells) : cells_of(items), items_of(cells) {}
  void add(std::size_t item, std::size_t cell) {
    cells_of[item].push_back(static_cast<std::int32_t>(cell));
    items_of[cell].push_back(static_cast<std::int32_t>(item));
  }

  std::vector<std::int32_t> colours(std::int32_t chunk, int threads) const {
    const FirstFitSizes sizes{static_cast<std::int32_t>(cells_of.size()), static_cast<std::int32_t>(items_of.size()),
                              chunk};
    const Team team(threads);
    std::vector<std::int32_t> colours;
    team.run([&] {
      colours = first_fit(
          sizes,
          [&](std::int32_t item, const auto& use) {
            for (const std::int32_t cell : cells_of[at(item)]) use(cell);
          },
          [&](std::int32_t cell, const auto& use) {
            for (const std::int32_t item : items_of[at(cell)]) use(item);
          },
          team);
    });
    return colours;
  }

  /// The plain way, with sets of neighbours.
  std::vector<std::int32_t> plain_colours(std::int32_t chunk) const {
    const auto items = static_cast<std::int32_t>(cells_of.size());
    std::vector<std::int32_t> colours(cells_of.size(), -1);
    for (const std::int32_t turn : chunks_in_turn((items + chunk - 1) / chunk))
      for (std::int32_t item = turn * chunk; item < std::min(items, (turn + 1) * chunk); ++item) {
        std::set<std::int32_t> taken;
        for (const std::int32_t cell : cells_of[at(item)])
          for (const std::int32_t other : items_of[at(cell)]) taken.insert(colours[at(other)]);
        std::int32_t colour = 0;
        while (taken.contains(colour)) ++colour;
        colours[at(item)] = colour;
      }
    return colours;
  }
};

/// Items of a long strip: each touches some cells near its own place.
Touching strip(std::size_t items, std::size_t cells, std::size_t reach) {
  std::mt19937 random(7);
  Touching touching(items, cells);
  for (std::size_t item = 0; item < items; ++item) {
    std::set<std::size_t> cells_here;
    for (int k = 0; k < 4; ++k) cells_here.insert(std::min(cells - 1, item * cells / items + random() % reach));
    for (const std::size_t cell : cells_here) touching.add(item, cell);
  }
  return touching;
}

TEST(FirstFit, GivesEachItemTheFirstFreeColour) {
  const Touching touching = strip(20'000, 5'000, 30);
  for (const std::int32_t chunk : {1, 8, 100, 1024, 100'000}) {
    const std::vector<std::int32_t> plain = touching.plain_colours(chunk);
    for (const int threads : kThreads)
      EXPECT_EQ(touching.colours(chunk, threads), plain) << chunk << ", " << threads << " threads";
  }
}

TEST(FirstFit, HasAsManyColoursAsItNeeds) {
  Touching touching(300, 3);
  for (std::size_t item = 0; item < 300; ++item) touching.add(item, item % 3 == 0 ? 0 : 1);
  for (std::size_t item = 0; item < 300; item += 7) touching.add(item, 2);
  for (const int threads : kThreads) {
    const std::vector<std::int32_t> colours = touching.colours(16, threads);
    EXPECT_EQ(colours, touching.plain_colours(16));
    EXPECT_GE(*std::ranges::max_element(colours), 199);
  }
}

TEST(FirstFit, ColoursNothing) {
  for (const int threads : kThreads) EXPECT_TRUE(Touching(0, 5).colours(8, threads).empty());
}

TEST(Rounds, KeepNeighboursApartAndInTurn) {
  constexpr std::int32_t kChunks = 500;
  std::mt19937 random(3);
  std::vector<std::pair<std::int32_t, std::int32_t>> neighbours;
  for (int i = 0; i < 3000; ++i) {
    const auto a = static_cast<std::int32_t>(random() % kChunks);
    const auto b = static_cast<std::int32_t>((at(a) + 1 + random() % 20) % kChunks);
    neighbours.emplace_back(a, b);
  }
  const Rounds rounds = rounds_of(kChunks, neighbours);
  std::vector<std::int32_t> turn(kChunks), round(kChunks, -1);
  const std::vector<std::int32_t> order = chunks_in_turn(kChunks);
  for (std::size_t i = 0; i < order.size(); ++i) turn[at(order[i])] = static_cast<std::int32_t>(i);
  for (std::size_t r = 0; r + 1 < rounds.begin.size(); ++r)
    for (std::int32_t i = rounds.begin[r]; i < rounds.begin[r + 1]; ++i)
      round[at(rounds.chunks[at(i)])] = static_cast<std::int32_t>(r);
  EXPECT_EQ(std::ranges::count(round, -1), 0);
  for (const auto& [a, b] : neighbours) {
    EXPECT_NE(round[at(a)], round[at(b)]);
    EXPECT_EQ(turn[at(a)] < turn[at(b)], round[at(a)] < round[at(b)]);
  }
  EXPECT_LT(rounds.begin.size(), 100U) << "most chunks need not wait for each other";
}

TEST(SortByColour, KeepsTheOrderWithinAColour) {
  std::mt19937 random(11);
  std::vector<std::int32_t> colours(50'000);
  for (std::int32_t& colour : colours) colour = static_cast<std::int32_t>(random() % 23);
  std::vector<std::int32_t> sorted(colours.size());
  std::iota(sorted.begin(), sorted.end(), 0);
  std::ranges::stable_sort(sorted, {}, [&](std::int32_t item) { return colours[at(item)]; });
  for (const int threads : kThreads) {
    const Team team(threads);
    ColourPlaces places;
    team.run([&] { places = sort_by_colour(colours, team); });
    ASSERT_EQ(places.begin.size(), 24U);
    EXPECT_EQ(places.begin.back(), 50'000);
    for (std::size_t i = 0; i < sorted.size(); ++i) {
      ASSERT_EQ(places.place[at(sorted[i])], static_cast<std::int32_t>(i));
      ASSERT_GE(static_cast<std::int32_t>(i), places.begin[at(colours[at(sorted[i])])]);
    }
  }
}

}  // namespace
}  // namespace varimesh
