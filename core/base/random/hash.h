// Numbers that look random and are always the same.
#pragma once

#include <cstdint>

namespace varimesh {

/// A permutation of the 32-bit numbers: Chris Wellons' lowbias32 (https://nullprogram.com/blog/2018/07/31/).
constexpr std::uint32_t hash(std::uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352dU;
  x ^= x >> 15;
  x *= 0x846ca68bU;
  x ^= x >> 16;
  return x;
}

}  // namespace varimesh
