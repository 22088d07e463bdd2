// Signed numbers as indices, and the positions of the entries of packed symmetric matrices.
#pragma once

#include <cstddef>

namespace varimesh {

/// Converts a non-negative number to an index of a standard container.
template <class Integer>
constexpr std::size_t at(Integer i) {
  return static_cast<std::size_t>(i);
}

/// The number of stored entries of a symmetric matrix with this many rows.
constexpr int triangle_size(int rows) { return rows * (rows + 1) / 2; }

/// The position of entry (i, j), j ≤ i, of a symmetric matrix that is stored as its lower triangle, row by row.
constexpr int lower_index(int i, int j) { return i * (i + 1) / 2 + j; }
/// The same for i and j in either order.
constexpr int symmetric_index(int i, int j) { return i >= j ? lower_index(i, j) : lower_index(j, i); }

}  // namespace varimesh
