// One step outwards: what turns a result that is rounded to nearest into a bound. Internal to core/quality.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

namespace varimesh::detail {

/// The next double above; NaN and infinity stay as they are. What std::nextafter says: every certificate takes six, and
/// a call takes longer than the bits do.
inline double above(double x) {
  if (!(x < std::numeric_limits<double>::infinity())) return x;
  if (x == 0) return std::numeric_limits<double>::denorm_min();
  const auto bits = std::bit_cast<std::int64_t>(x);
  return std::bit_cast<double>(x > 0 ? bits + 1 : bits - 1);
}

/// The next double below, likewise.
inline double below(double x) { return -above(-x); }

}  // namespace varimesh::detail
