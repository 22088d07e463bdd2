// Fixed-point numbers in 16 bits: a number is stored as a whole number of steps, the largest as 32767 of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace varimesh {

inline constexpr float kLargestFixedPoint = std::numeric_limits<std::int16_t>::max();

/// Rounds to the nearest; larger numbers become the largest.
inline std::int16_t to_fixed_point(double steps) {
  return static_cast<std::int16_t>(std::lrint(std::clamp<double>(steps, -kLargestFixedPoint, kLargestFixedPoint)));
}

}  // namespace varimesh
