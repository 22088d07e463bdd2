// Sums and maxima over many terms that depend neither on the number of threads nor on how these divide the work.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <mutex>

#include "core/base/exact_sum.h"
#include "core/base/team.h"

namespace varimesh {

/// Adds up terms in blocks. The terms of a block are added in double precision, always in the same pattern. The sums of
/// the blocks are added exactly and rounded once, at the end. So the bits are the same whichever thread has which
/// blocks, and in whatever order the threads end. Processes that have whole blocks could add their exact sums with the
/// same result.
///
/// Sums of numbers with a fraction over the cells or nodes of a mesh belong here; the test architecture.sums finds the
/// usual forms of others. `grain`: how many terms are worth a task, as in Team. Call everything inside team.run().
class Reduction {
 public:
  /// Terms in a block. Adding 10⁷ products takes no longer than a plain loop from 256 on (docs/performance.md).
  static constexpr std::size_t kBlock = 256;

  explicit Reduction(const Team& team) : team_(team) {}

  /// Σ term(i) for 0 ≤ i < count. term() is called once for each i.
  template <class Term>
  double sum(std::size_t count, std::size_t grain, const Term& term) const {
    return sum_of_blocks(count, grain,
                         [&](std::size_t begin, std::size_t end) { return sum_in_lanes(begin, end, term); });
  }

  /// The same for terms of which only sums are known: part(begin, end) returns the sum of a whole block.
  template <class Part>
  double sum_of_blocks(std::size_t count, std::size_t grain, const Part& part) const {
    if (count <= kBlock) return count == 0 ? 0 : part(std::size_t{0}, count);
    return exact_sum_in_blocks(count, grain, part).value();
  }

  /// The same before it is rounded, so that sums of several ranks can be added.
  template <class Part>
  ExactSum exact_sum_in_blocks(std::size_t count, std::size_t grain, const Part& part) const {
    ExactSum sum;
    std::mutex mutex;
    const std::size_t blocks = (count + kBlock - 1) / kBlock;
    team_.for_ranges(blocks, std::max<std::size_t>(1, grain / kBlock), [&](std::size_t first, std::size_t last) {
      ExactSum mine;
      for (std::size_t block = first; block < last; ++block)
        mine.add(part(block * kBlock, std::min(count, (block + 1) * kBlock)));
      const std::scoped_lock lock(mutex);
      sum.add(mine);
    });
    return sum;
  }

  /// Σ term(i) without rounding, so that sums of several ranks can be added.
  template <class Term>
  ExactSum exact(std::size_t count, std::size_t grain, const Term& term) const {
    ExactSum sum;
    std::mutex mutex;
    team_.for_ranges(count, grain, [&](std::size_t begin, std::size_t end) {
      ExactSum mine;
      for (std::size_t i = begin; i < end; ++i) mine.add(term(i));
      const std::scoped_lock lock(mutex);
      sum.add(mine);
    });
    return sum;
  }

  /// The largest term(i), or `least` if that is larger.
  template <class Term>
  double largest(std::size_t count, std::size_t grain, const Term& term, double least = 0) const {
    double largest = least;
    std::mutex mutex;
    team_.for_ranges(count, grain, [&](std::size_t begin, std::size_t end) {
      double mine = least;
      for (std::size_t i = begin; i < end; ++i) mine = std::max(mine, static_cast<double>(term(i)));
      const std::scoped_lock lock(mutex);
      largest = std::max(largest, mine);
    });
    return largest;
  }

  /// How sum() adds up a block: in lanes, because a processor adds several numbers at once if none waits for another.
  template <class Term>
  static double sum_in_lanes(std::size_t begin, std::size_t end, const Term& term) {
    constexpr std::size_t kLanes = 8;
    std::array<double, kLanes> lanes{};
    std::size_t i = begin;
    for (; i + kLanes <= end; i += kLanes)
      for (std::size_t lane = 0; lane < kLanes; ++lane) lanes[lane] += term(i + lane);
    for (std::size_t lane = 0; i < end; ++i, ++lane) lanes[lane] += term(i);
    for (std::size_t half = kLanes / 2; half > 0; half /= 2)
      for (std::size_t lane = 0; lane < half; ++lane) lanes[lane] += lanes[lane + half];
    return lanes[0];
  }

 private:
  const Team& team_;
};

}  // namespace varimesh
