// Scales that bring numbers near 1 without rounding them.
#pragma once

#include <cmath>

namespace varimesh {

/// The largest power of two that is not above `size`; 1 if `size` is not positive or not finite. Dividing by it adds no
/// rounding.
inline double power_of_two(double size) {
  return size > 0 && std::isfinite(size) ? std::ldexp(1.0, std::ilogb(size)) : 1.0;
}

}  // namespace varimesh
