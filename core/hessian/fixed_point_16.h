// Numbers in 16 bits: so many whole steps, of which the largest number has 32767.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace varimesh {

inline constexpr float kLargestFixedPoint = std::numeric_limits<std::int16_t>::max();

/// To the nearest; what is beyond the largest is the largest.
inline std::int16_t to_fixed_point(double steps) {
  return static_cast<std::int16_t>(std::lrint(std::clamp<double>(steps, -kLargestFixedPoint, kLargestFixedPoint)));
}

}  // namespace varimesh
