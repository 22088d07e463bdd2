// Sums and maxima over the terms of all ranks.
#pragma once

#include <cstddef>

#include "core/base/reduction.h"
#include "core/base/stop_token.h"
#include "core/ranks/ranks.h"

namespace varimesh {

/// A Reduction over the terms of all ranks. The terms are numbered through, and cut into blocks of Reduction::kBlock. A
/// rank has the terms of some of these blocks. The results have the bits of a Reduction of one process over all terms.
/// All ranks call each function together, inside team.run(). With one rank it is a Reduction.
///
/// With several ranks the team must have no token, because a rank that stops by itself leaves the others waiting. The
/// token is `stop`, which may be null. The ranks look at it whenever they take a sum, and throw Interrupted together if
/// one of them is to stop.
class WholeReduction {
 public:
  WholeReduction(const Team& team, const Ranks& ranks, const StopToken* stop = nullptr)
      : reduction_(team), ranks_(ranks), stop_(stop) {}

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
    bool stops = false;
    const double sum = ranks_.sum(mine, stop_ != nullptr && stop_->stopped(), stops);
    if (stops) throw Interrupted();
    return sum;
  }

  Reduction reduction_;
  const Ranks& ranks_;
  const StopToken* stop_;
};

}  // namespace varimesh
