// Shifts points at random, by the same amount on every machine.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
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

/// Moves the point by a distance of at most `most`. Different keys give different directions.
inline void shift(std::array<double, 3>& point, std::uint64_t key, double most) {
  std::array<double, 3> by{};
  for (std::size_t k = 0; k < 3; ++k) by[k] = random_number(3 * key + k);
  const double long_as = std::sqrt(by[0] * by[0] + by[1] * by[1] + by[2] * by[2]);
  for (std::size_t k = 0; k < 3; ++k) point[k] += most * by[k] / std::max(1.0, long_as);
}

}  // namespace varimesh::bench
