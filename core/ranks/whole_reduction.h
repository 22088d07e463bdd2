// Sums and maxima over the terms of all ranks.
#pragma once

#include <cstddef>

#include "core/base/reduction.h"
#include "core/ranks/ranks.h"
#include "core/ranks/stop_together.h"

namespace varimesh {

/// A Reduction over the terms of all ranks. The terms are numbered through, and cut into blocks of Reduction::kBlock. A
/// rank has the terms of some of these blocks. The results have the bits of a Reduction of one process over all terms.
/// All ranks call each function together, inside team.run(). With one rank it is a Reduction.
///
/// With several ranks, the team's token must be one of all ranks (stop_together()), or none must have one. Whenever the
/// ranks take a sum, they look together, without another message.
class WholeReduction {
 public:
  WholeReduction(const Team& team, const Ranks& ranks) : team_(team), reduction_(team), ranks_(ranks) {}

  const Ranks& ranks() const { return ranks_; }

  /// As Reduction::sum().
  template <class Term>
  double sum(std::size_t count, std::size_t grain, const Term& term) const {
    if (ranks_.count() == 1) return reduction_.sum(count, grain, term);
    return of_all(reduction_.exact_sum_in_blocks(
        count, grain, [&](std::size_t begin, std::size_t end) { return Reduction::sum_in_lanes(begin, end, term); }));
  }
  /// As Reduction::sum_of_blocks().
  template <class Part>
  double sum_of_blocks(std::size_t count, std::size_t grain, const Part& part) const {
    if (ranks_.count() == 1) return reduction_.sum_of_blocks(count, grain, part);
    return of_all(reduction_.exact_sum_in_blocks(count, grain, part));
  }
  /// As Reduction::largest().
  template <class Term>
  double largest(std::size_t count, std::size_t grain, const Term& term, double least = 0) const {
    const double mine = reduction_.largest(count, grain, term, least);
    return ranks_.count() == 1 ? mine : ranks_.largest(mine);
  }

 private:
  double of_all(const ExactSum& mine) const {
    const StopToken* const stop = team_.stop();
    bool stops = false;
    const double sum = ranks_.sum(mine, stop != nullptr && stop->wish() != StopToken::Reason::None, stops);
    if (stops) team_.look_together();
    return sum;
  }

  const Team& team_;
  Reduction reduction_;
  const Ranks& ranks_;
};

}  // namespace varimesh
