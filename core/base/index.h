// Signed numbers as places in arrays, and where the entries of packed symmetric matrices are.
#pragma once

#include <cstddef>

namespace varimesh {

/// A number that is not negative, as an index of the standard library's containers.
template <class Integer>
constexpr std::size_t at(Integer i) {
  return static_cast<std::size_t>(i);
}

/// Numbers in a symmetric matrix with this many rows.
constexpr int triangle_size(int rows) { return rows * (rows + 1) / 2; }

/// Where entry (i, j), j ≤ i, of a symmetric matrix is in its lower triangle by rows.
constexpr int lower_index(int i, int j) { return i * (i + 1) / 2 + j; }
/// The same in any order of i and j.
constexpr int symmetric_index(int i, int j) { return i >= j ? lower_index(i, j) : lower_index(j, i); }

}  // namespace varimesh
