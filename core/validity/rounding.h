// Floating-point rounding: how large it can get, and one step outwards to make a bound of a rounded number. Internal to
// the library.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

namespace varimesh::detail {

/// γ_k = k u / (1 − k u): a bound on the relative error of k roundings in a row, each at most u (N. J. Higham, Accuracy
/// and Stability of Numerical Algorithms, SIAM, 2002, section 3.1).
template <class Real>
constexpr Real relative_rounding(int roundings, Real unit) {
  return Real(roundings) * unit / (1 - Real(roundings) * unit);
}

/// The next double above; NaN and infinity stay as they are. The same as std::nextafter, but inline: every certificate
/// takes six, and a call takes longer than the step itself.
inline double next_above(double x) {
  if (!(x < std::numeric_limits<double>::infinity())) return x;
  if (x == 0) return std::numeric_limits<double>::denorm_min();
  const auto bits = std::bit_cast<std::int64_t>(x);
  return std::bit_cast<double>(x > 0 ? bits + 1 : bits - 1);
}

/// The next double below; NaN and infinity stay as they are.
inline double next_below(double x) { return -next_above(-x); }

}  // namespace varimesh::detail
