// The edges or faces of cells, each once, found by their vertices: the tables of core/mesh/topology.h.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/base/io/scanner.h"
#include "core/base/shared_work.h"

namespace varimesh {

/// Counts memory before it is taken; a negative number of bytes is given back. It may throw. Empty: nobody counts.
using CountMemory = std::function<void(std::int64_t bytes)>;

/// Marks of numbers from 0 on, which say how many marks are before a number.
class RankedMarks {
 public:
  explicit RankedMarks(std::size_t size) : words_(size / 64 + 1, 0), before_(words_.size(), 0) {}
  static std::size_t bytes(std::size_t size) {
    return (size / 64 + 1) * (sizeof(std::uint64_t) + sizeof(std::uint32_t));
  }

  void mark(std::size_t i) { words_[i / 64] |= std::uint64_t(1) << i % 64; }
  bool is_marked(std::size_t i) const { return (words_[i / 64] >> i % 64 & 1) != 0; }
  /// Must be called after the last mark. Returns the number of all marks.
  std::uint32_t finish() {
    std::uint32_t sum = 0;
    for (std::size_t w = 0; w < words_.size(); ++w) {
      before_[w] = sum;
      sum += std::uint32_t(std::popcount(words_[w]));
    }
    return sum;
  }
  std::uint32_t before(std::size_t i) const {
    const std::uint64_t lower = words_[i / 64] & ((std::uint64_t(1) << i % 64) - 1);
    return before_[i / 64] + std::uint32_t(std::popcount(lower));
  }

 private:
  std::vector<std::uint64_t> words_;
  std::vector<std::uint32_t> before_;  ///< How many marks are before each word.
};

/// Parts with R + 1 vertices. They lie in buckets by their lowest vertex, and are sorted there. Cells that are near
/// each other in a mesh have vertices with near numbers, so most look-ups find their bucket in a cache.
template <std::size_t R>
class PartTable {
 public:
  using Rest = std::array<std::int32_t, R>;  ///< The vertices besides the lowest, ascending.
  struct Part {
    Rest rest;
    std::uint32_t number;
  };

  /// Finds the parts of all cells.
  ///
  /// @param vertices the number of vertices of the mesh
  /// @param visit    visit(enter) calls enter(lowest, rest, occurrence) for each part of each cell, from several
  ///                 threads if the team has them. Occurrences are all different. It does the same in every call.
  /// @param marks    gets a mark for the first occurrence of each part
  template <class Visit>
  void build(std::int32_t vertices, const Team& team, const Visit& visit, RankedMarks& marks,
             const CountMemory& memory) {
    const auto buckets = std::size_t(vertices);
    take(memory, 3 * (buckets + 1) * sizeof(std::uint32_t));
    std::vector<std::uint32_t> start(buckets + 1, 0);
    visit([&](std::int32_t low, const Rest&, std::uint32_t) { count_up(start[std::size_t(low)], team); });
    const std::size_t all = sums_before(start);
    first_.assign(all == 0 ? 0 : buckets + 1, 0);
    // Room for as many as there could be; what is not used of it is never touched.
    parts_.reserve(all);
    std::vector<Part> entries;
    for (std::size_t low = 0, high = 0; all > 0 && low < buckets; low = high) {
      const std::uint32_t base = start[low];
      high = low + 1;
      while (high < buckets && start[high + 1] - base <= kEntries) ++high;
      const std::size_t count = start[high] - base;
      if (count > entries.capacity()) take(memory, (count - entries.capacity()) * sizeof(Part));
      entries.resize(count);
      std::vector<std::uint32_t> next(start.begin() + std::ptrdiff_t(low), start.begin() + std::ptrdiff_t(high));
      visit([&](std::int32_t vertex, const Rest& rest, std::uint32_t occurrence) {
        const std::size_t bucket = std::size_t(vertex) - low;
        if (bucket < next.size()) entries[count_up(next[bucket], team) - base] = {rest, occurrence};
      });
      team.for_ranges(high - low, kBucketsPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = low + begin; b < low + end; ++b) {
          Part* const first = entries.data() + (start[b] - base);
          first_[b + 1] = sort_and_shrink(first, entries.data() + (start[b + 1] - base));
        }
      });
      std::size_t kept = 0;
      for (std::size_t b = low; b < high; ++b) kept += first_[b + 1];
      take(memory, kept * sizeof(Part));
      for (std::size_t b = low; b < high; ++b) {
        const Part* const first = entries.data() + (start[b] - base);
        parts_.insert(parts_.end(), first, first + first_[b + 1]);
        for (const Part* part = first; part < first + first_[b + 1]; ++part) marks.mark(part->number);
      }
    }
    if (memory) memory(-std::int64_t(entries.capacity() * sizeof(Part) + 2 * start.size() * sizeof(std::uint32_t)));
    for (std::size_t b = 1; b < first_.size(); ++b) first_[b] += first_[b - 1];
  }

  /// Replaces the first occurrence of each part by its number: how many first occurrences there are before.
  void number(const RankedMarks& marks, const Team& team) {
    team.for_ranges(parts_.size(), kBucketsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t p = begin; p < end; ++p) parts_[p].number = marks.before(parts_[p].number);
    });
  }

  std::size_t size() const { return parts_.size(); }
  std::span<const Part> parts() const { return parts_; }

  /// The place of a part in the table; −1 if no cell has it.
  std::int64_t find(std::int32_t low, const Rest& rest) const {
    if (low < 0 || std::size_t(low) + 1 >= first_.size()) return -1;
    const Part* const begin = parts_.data() + first_[std::size_t(low)];
    const Part* const end = parts_.data() + first_[std::size_t(low) + 1];
    const Part* at = begin;
    constexpr std::ptrdiff_t kFew = 16;
    if (end - begin > kFew)
      at = std::lower_bound(begin, end, rest,
                            [](const Part& part, const Rest& wanted) { return less(part.rest, wanted); });
    else
      while (at < end && !same(at->rest, rest)) ++at;
    return at < end && same(at->rest, rest) ? at - parts_.data() : -1;
  }

 private:
  /// One range of vertices is done at a time, so that the parts of all cells are never all in memory.
  static constexpr std::uint32_t kEntries = (std::uint32_t(1) << 24) / sizeof(Part);
  static constexpr std::size_t kBucketsPerTask = 4096;

  // The comparisons of std::array call memcmp(), which takes longer than the rest of the search.
  static bool same(const Rest& a, const Rest& b) {
    bool all = true;
    for (std::size_t k = 0; k < R; ++k) all = all && a[k] == b[k];
    return all;
  }
  static bool less(const Rest& a, const Rest& b) {
    for (std::size_t k = 0; k + 1 < R; ++k)
      if (a[k] != b[k]) return a[k] < b[k];
    return a[R - 1] < b[R - 1];
  }

  static void take(const CountMemory& memory, std::size_t bytes) {
    if (memory) memory(std::int64_t(bytes));
  }

  /// Sorts a bucket, keeps the first occurrence of each part, and returns how many there are.
  static std::uint32_t sort_and_shrink(Part* begin, Part* end) {
    std::sort(begin, end,
              [](const Part& a, const Part& b) { return a.rest != b.rest ? a.rest < b.rest : a.number < b.number; });
    return std::uint32_t(std::unique(begin, end, [](const Part& a, const Part& b) { return same(a.rest, b.rest); }) -
                         begin);
  }

  std::vector<std::uint32_t> first_;  ///< Of each bucket, and the end; empty if there are no parts.
  std::vector<Part> parts_;
};

}  // namespace varimesh
