// Loops that a team shares and whose results do not depend on the number of threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/threads/pipeline.h"

namespace varimesh {

/// Adds 1 to a number that several threads of the team may count with, and returns what it was. The final number does
/// not depend on the order; what each call returns does.
template <class Number>
Number count_up(Number& number, const Team& team) {
  if (team.threads() == 1) return number++;
  return std::atomic_ref(number).fetch_add(1, std::memory_order_relaxed);
}

/// Lowers a number that several threads of the team may lower to `value`, if it is above it, and returns what it was.
/// The final number does not depend on the order.
inline std::int32_t lower_to(std::int32_t& number, std::int32_t value, const Team& team) {
  if (team.threads() == 1) return std::exchange(number, std::min(number, value));
  std::atomic_ref shared(number);
  std::int32_t seen = shared.load(std::memory_order_relaxed);
  while (value < seen && !shared.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
  }
  return seen;
}

/// Turns counts into where each begins: numbers[i] becomes the sum of all before it, and the sum of all is returned.
template <class Number>
Number sums_before(std::vector<Number>& numbers) {
  Number sum = 0;
  for (Number& number : numbers) sum += std::exchange(number, sum);
  return sum;
}

/// The number of chunks of `size` items that `count` items make; the last one may be shorter.
constexpr std::size_t chunks_of(std::size_t count, std::size_t size) { return (count + size - 1) / size; }

/// Calls body(chunk, begin, end) for the chunks of `size` items that make up 0 ≤ i < count. The chunks do not depend on
/// the number of threads, so they may have a result each. Call it inside team.run().
template <class Body>
void for_chunks(const Team& team, std::size_t count, std::size_t size, const Body& body) {
  team.for_each(static_cast<std::int32_t>(chunks_of(count, size)), 1, [&](std::int32_t chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * size;
    body(static_cast<std::size_t>(chunk), begin, std::min(begin + size, count));
  });
}

/// The smallest i < count for which is(i) is true; `count` if there is none. `is` is also called for larger i. `grain`:
/// as in Team. Call it inside team.run().
template <class Is>
std::size_t first_of(const Team& team, std::size_t count, std::size_t grain, const Is& is) {
  std::atomic<std::size_t> first{count};
  team.for_ranges(count, grain, [&](std::size_t begin, std::size_t end) {
    if (begin >= first.load(std::memory_order_relaxed)) return;
    std::size_t i = begin;
    while (i < end && !is(i)) ++i;
    std::size_t seen = first.load(std::memory_order_relaxed);
    while (i < end && i < seen && !first.compare_exchange_weak(seen, i, std::memory_order_relaxed)) {
    }
  });
  return first;
}

/// How many i < count there are for which is(i) is true. is() is called once for each i. `grain`: as in Team. Call it
/// inside team.run().
template <class Is>
std::int64_t count_where(const Team& team, std::size_t count, std::size_t grain, const Is& is) {
  std::atomic<std::int64_t> found{0};
  team.for_ranges(count, grain, [&](std::size_t begin, std::size_t end) {
    std::int64_t mine = 0;
    for (std::size_t i = begin; i < end; ++i) mine += is(i) ? 1 : 0;
    found.fetch_add(mine, std::memory_order_relaxed);
  });
  return found;
}

/// Those i, ascending. Call it inside team.run().
template <class Is>
std::vector<std::int32_t> indices_where(const Team& team, std::size_t count, std::size_t grain, const Is& is) {
  std::vector<std::size_t> next(chunks_of(count, grain) + 1, 0);  // by chunk: how many, then where they begin
  for_chunks(team, count, grain, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) next[chunk] += is(i) ? 1 : 0;
  });
  std::vector<std::int32_t> indices(sums_before(next));
  if (indices.empty()) return indices;
  for_chunks(team, count, grain, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::size_t place = next[chunk];
    for (std::size_t i = begin; i < end && place < next[chunk + 1]; ++i)
      if (is(i)) indices[place++] = static_cast<std::int32_t>(i);
  });
  return indices;
}

/// How many of the first n numbers of two merged sorted ranges come from `left`. The numbers are all different.
template <class T, class Less>
std::size_t taken_of_left(std::span<const T> left, std::span<const T> right, std::size_t n, const Less& less) {
  std::size_t low = n > right.size() ? n - right.size() : 0, high = std::min(n, left.size());
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (less(left[middle], right[n - middle - 1]))
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

/// Sorts numbers that are all different, so that the result is unique. Call it inside team.run().
template <class T, class Less = std::less<>>
void sort_distinct(const Team& team, std::vector<T>& numbers, const Less& less = {}) {
  constexpr std::size_t kFewest = 4096;  // numbers that are worth a piece
  const std::size_t count = numbers.size();
  if (team.threads() == 1 || count < 2 * kFewest) return std::sort(numbers.begin(), numbers.end(), less);
  std::size_t width = kFewest;
  while (chunks_of(count, width) > 2 * static_cast<std::size_t>(team.threads())) width *= 2;
  for_chunks(team, count, width, [&](std::size_t, std::size_t begin, std::size_t end) {
    std::sort(numbers.data() + begin, numbers.data() + end, less);
  });
  std::vector<T> merged(count);
  for (; width < count; width *= 2) {
    for_chunks(team, count, kFewest, [&](std::size_t, std::size_t begin, std::size_t end) {
      const std::size_t start = begin / (2 * width) * (2 * width);  // of the two ranges; pieces do not cross them
      const std::size_t middle = std::min(count, start + width), stop = std::min(count, start + 2 * width);
      const std::span<const T> left(numbers.data() + start, middle - start),
          right(numbers.data() + middle, stop - middle);
      const std::size_t from_left = taken_of_left(left, right, begin - start, less);
      const std::size_t to_left = taken_of_left(left, right, end - start, less);
      std::merge(left.begin() + static_cast<std::ptrdiff_t>(from_left),
                 left.begin() + static_cast<std::ptrdiff_t>(to_left),
                 right.begin() + static_cast<std::ptrdiff_t>(begin - start - from_left),
                 right.begin() + static_cast<std::ptrdiff_t>(end - start - to_left), merged.data() + begin, less);
    });
    numbers.swap(merged);
  }
}

/// Copies the numbers `from` to an array of the same size. It is never interrupted. Call it inside team.run().
template <class T>
void shared_copy(std::span<const T> from, std::span<T> to, const Team& team) {
  constexpr std::size_t kPerTask = 16384;
  team.without_stop().for_ranges(from.size(), kPerTask, [&](std::size_t begin, std::size_t end) {
    std::copy_n(from.data() + begin, end - begin, to.data() + begin);
  });
}

/// A new array with these numbers. The threads share the work of fetching its memory. Call it inside team.run().
template <class T>
UntouchedVector<T> shared_copy(const std::vector<T>& from, const Team& team) {
  UntouchedVector<T> to(from.size());
  shared_copy<T>(from, to, team);
  return to;
}

/// Works on pieces that must be taken in order. next() returns the next piece, or nothing after the last one;
/// make(piece) does the work, and several threads do it at the same time; take(result) receives the results in the
/// order of the pieces. next() and take() are each called by one thread at a time. At most threads + 2 pieces are in
/// memory. Call it inside team.run().
///
/// If take() returns false, the rest is dropped; next() and make() may still be called for a few more pieces.
template <class Next, class Make, class Take>
void in_order(const Team& team, Next&& next, const Make& make, const Take& take) {
  if (team.threads() == 1) {
    for (auto piece = next(); piece; piece = next())
      if (!take(make(*piece))) return;
    return;
  }
  Pipeline pipeline(next, make, take, static_cast<std::size_t>(team.threads()) + 2);
  team.without_stop().for_each(team.threads(), 1, [&](std::int32_t) { pipeline.work(); });
}

}  // namespace varimesh
