// Numbers that are joined to sets, each named by its smallest member. Internal to the library.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "core/base/index.h"

namespace varimesh::detail {

/// The numbers 0, …, count − 1, at first each in a set of its own (union-find with path halving).
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }

  /// The smallest member of the set that k is in.
  std::int32_t find(std::int32_t k) {
    while (parent_[at(k)] != k) k = parent_[at(k)] = parent_[at(parent_[at(k)])];
    return k;
  }
  /// Makes the sets of a and b one.
  void join(std::int32_t a, std::int32_t b) {
    a = find(a);
    b = find(b);
    parent_[at(std::max(a, b))] = std::min(a, b);
  }

 private:
  std::vector<std::int32_t> parent_;
};

}  // namespace varimesh::detail
