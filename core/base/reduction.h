// Sums and maxima over many terms that do not depend on the number of threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <numeric>
#include <vector>

#include "core/base/team.h"

namespace varimesh {

/// Combines term(i) for 0 ≤ i < count in tasks of `grain` terms each, and the results of the tasks in their order.
class Reduction {
 public:
  explicit Reduction(const Team& team) : team_(team) {}

  /// Σ term(i)
  template <class Term>
  double sum(std::size_t count, std::size_t grain, const Term& term) {
    return reduce(count, grain, term, std::plus<>());
  }

  /// The largest term(i), or 0 if that is larger.
  template <class Term>
  double largest(std::size_t count, std::size_t grain, const Term& term) {
    return reduce(count, grain, term, [](double a, double b) { return std::max(a, b); });
  }

 private:
  template <class Term, class Combine>
  double reduce(std::size_t count, std::size_t grain, const Term& term, const Combine& combine) {
    const std::size_t tasks = (count + grain - 1) / grain;
    partial_.resize(std::max(partial_.size(), tasks));
    team_.for_each(static_cast<std::int32_t>(tasks), 1, [&](std::int32_t task) {
      double one = 0;
      for (std::size_t i = task * grain; i < std::min(count, (task + 1) * grain); ++i) one = combine(one, term(i));
      partial_[task] = one;
    });
    return std::accumulate(partial_.begin(), partial_.begin() + static_cast<std::ptrdiff_t>(tasks), 0.0, combine);
  }

  const Team& team_;
  std::vector<double> partial_;  ///< By task.
};

}  // namespace varimesh
