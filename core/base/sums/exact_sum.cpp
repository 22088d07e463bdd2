#include "core/base/exact_sum.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace varimesh {
namespace {

constexpr int kBits = 32;
constexpr std::int64_t kBase = std::int64_t{1} << kBits;
constexpr int kLeast = 1074;  // the least double is 2^−1074
constexpr std::int64_t kMostTerms = std::int64_t{1} << 30;
constexpr int kMantissa = 52, kExponent = 11;

}  // namespace

void ExactSum::add(double term) {
  const auto bits = std::bit_cast<std::uint64_t>(term);
  const auto exponent = static_cast<int>(bits >> kMantissa & ((1U << kExponent) - 1));
  if (exponent == (1 << kExponent) - 1) {
    ++numbers_[kLimbs + (std::isnan(term) ? 2U : term > 0 ? 0U : 1U)];
    return;
  }
  std::uint64_t mantissa = bits & ((std::uint64_t{1} << kMantissa) - 1);
  // A denormal number has no hidden bit, and the exponent of the least normal one.
  if (exponent > 0) mantissa |= std::uint64_t{1} << kMantissa;
  const int shift = exponent > 0 ? exponent - 1 : 0;
  const auto limb = static_cast<std::size_t>(shift / kBits);
  const int within = shift % kBits;
  // At most 53 + 31 bits, in three limbs.
  const std::uint64_t low = mantissa << within;
  const std::uint64_t high = within == 0 ? 0 : mantissa >> (64 - within);
  const std::int64_t sign = term < 0 ? -1 : 1;
  numbers_[limb] += sign * static_cast<std::int64_t>(low & (kBase - 1));
  numbers_[limb + 1] += sign * static_cast<std::int64_t>(low >> kBits);
  numbers_[limb + 2] += sign * static_cast<std::int64_t>(high);
  if (++terms_ == kMostTerms) carry();
}

void ExactSum::add(const ExactSum& other) {
  ExactSum settled = other;
  settled.carry();
  for (std::size_t i = 0; i < numbers_.size(); ++i) numbers_[i] += settled.numbers_[i];
  if (++terms_ == kMostTerms) carry();
}

/// Afterwards all limbs but the last are between 0 and 2³² − 1. The last has the sign of the sum.
void ExactSum::carry() {
  for (std::size_t i = 0; i + 1 < kLimbs; ++i) {
    const std::int64_t rest = numbers_[i] & (kBase - 1);
    numbers_[i + 1] += (numbers_[i] - rest) / kBase;
    numbers_[i] = rest;
  }
  terms_ = 0;
}

ExactSum::Numbers& ExactSum::settled() {
  carry();
  return numbers_;
}

double ExactSum::value() const {
  const auto plus = numbers_[kLimbs], minus = numbers_[kLimbs + 1], none = numbers_[kLimbs + 2];
  if (none > 0 || (plus > 0 && minus > 0)) return std::numeric_limits<double>::quiet_NaN();
  if (plus > 0 || minus > 0) return (plus > 0 ? 1 : -1) * std::numeric_limits<double>::infinity();
  ExactSum magnitude = *this;
  magnitude.carry();
  const bool negative = magnitude.numbers_[kLimbs - 1] < 0;
  if (negative) {
    for (std::size_t i = 0; i < kLimbs; ++i) magnitude.numbers_[i] = -magnitude.numbers_[i];
    magnitude.carry();
  }
  std::size_t top = kLimbs;
  while (top > 0 && magnitude.numbers_[top - 1] == 0) --top;
  if (top == 0) return 0;
  // The bits of the highest three limbs, left-aligned in 64. A bit that was lost below decides only whether the rest is
  // exactly one half.
  const auto limb = [&](std::size_t below) {
    return top > below ? static_cast<std::uint64_t>(magnitude.numbers_[top - 1 - below]) : 0;
  };
  const int leading = std::countl_zero(limb(0)) - kBits;  // zeros above the highest bit of its 32
  std::uint64_t head = limb(0) << kBits | limb(1);
  head = leading == 0 ? head : head << leading | limb(2) >> (kBits - leading);
  bool lost = leading == 0 ? limb(2) != 0 : (limb(2) << leading & (kBase - 1)) != 0;
  for (std::size_t below = 3; below < top; ++below) lost |= limb(below) != 0;
  // The value is head · 2^exponent. A denormal result has fewer bits, but then nothing below 2^−1074 exists.
  const int exponent = static_cast<int>(top - 2) * kBits - leading - kLeast;
  constexpr int kDropped = 64 - kMantissa - 1;
  const int dropped = std::max(kDropped, -kLeast - exponent);
  if (dropped < 64) {
    const std::uint64_t half = std::uint64_t{1} << (dropped - 1), rest = head & (2 * half - 1);
    head >>= dropped;
    if (rest > half || (rest == half && (lost || (head & 1) != 0))) ++head;
  } else {
    head = 0;
  }
  return (negative ? -1 : 1) * std::ldexp(static_cast<double>(head), exponent + dropped);
}

ExactSum exact_sum(std::span<const double> terms) {
  ExactSum sum;
  for (const double term : terms) sum.add(term);
  return sum;
}

}  // namespace varimesh
