// Shifts points at random, by the same amount on every machine.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace varimesh::bench {

/// A number in [−1, 1) that depends only on `key`: S. Vigna's splitmix64.
inline double random_number(std::uint64_t key) {
  key += 0x9e3779b97f4a7c15u;
  key = (key ^ (key >> 30)) * 0xbf58476d1ce4e5b9u;
  key = (key ^ (key >> 27)) * 0x94d049bb133111ebu;
  key ^= key >> 31;
  return static_cast<double>(key >> 11) * 0x1p-52 - 1;
}

/// Moves the point along each axis by at most `most`. Different keys give different numbers.
inline void shift(std::array<double, 3>& point, std::uint64_t key, double most) {
  for (std::size_t k = 0; k < 3; ++k) point[k] += most * random_number(3 * key + k);
}

}  // namespace varimesh::bench
