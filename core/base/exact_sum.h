// Sums of doubles without rounding, so that they do not depend on the order of the terms.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace varimesh {

/// The exact sum of any doubles, rounded once, when value() is called.
///
/// A double is an integer times 2^−1074, and has at most 2098 bits. Limb i of the sum counts multiples of 2^(32 i −
/// 1074) in 64 bits, so 2³⁰ terms can be added before carries must be passed on (U. Kulisch, W. Miranker, The
/// arithmetic of the digital computer, SIAM Review 28, 1986). The sum of several sums is the sum of their limbs, number
/// by number.
class ExactSum {
 public:
  static constexpr std::size_t kLimbs = 68;
  /// The limbs, and how many terms were +∞, −∞ and not a number.
  using Numbers = std::array<std::int64_t, kLimbs + 3>;

  void add(double term);
  void add(const ExactSum& other);

  /// The sum, rounded to the nearest double; halves to even.
  double value() const;

  /// The numbers of this sum after all carries; the numbers of up to 2³⁰ sums can then be added one by one.
  Numbers& settled();

 private:
  void carry();

  Numbers numbers_{};
  std::int64_t terms_ = 0;  ///< Since the last carry.
};

/// The sum of the terms.
ExactSum exact_sum(std::span<const double> terms);

}  // namespace varimesh
