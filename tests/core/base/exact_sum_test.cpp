// Exact sums: known answers, and any order of the terms.
#include "core/base/exact_sum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace varimesh {
namespace {

using Limits = std::numeric_limits<double>;

double sum(const std::vector<double>& terms) { return exact_sum(terms).value(); }

TEST(ExactSum, LosesNoTerm) {
  EXPECT_EQ(sum({}), 0);
  EXPECT_EQ(sum({1e300, 1, -1e300}), 1);
  EXPECT_EQ(sum({1e-300, 1e300, -1e300}), 1e-300);
  EXPECT_EQ(sum({Limits::denorm_min(), 1, -1}), Limits::denorm_min());
  EXPECT_EQ(sum({-Limits::denorm_min(), -Limits::min()}), -Limits::min() - Limits::denorm_min());
  EXPECT_EQ(sum({0.1, 0.2, -0.3}), std::ldexp(1, -55));  // of the doubles next to these numbers
}

TEST(ExactSum, RoundsOnceAndHalvesToEven) {
  const double ulp = Limits::epsilon();
  EXPECT_EQ(sum({1, ulp / 2}), 1);
  EXPECT_EQ(sum({1 + ulp, ulp / 2}), 1 + 2 * ulp);
  EXPECT_EQ(sum({1, ulp / 2, Limits::denorm_min()}), 1 + ulp);
  EXPECT_EQ(sum({-1, -ulp / 2, -Limits::denorm_min()}), -1 - ulp);
  EXPECT_EQ(sum({2 - ulp, ulp / 2}), 2);
}

TEST(ExactSum, IsOneTermIfThereIsOnlyOne) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 100000; ++i) {
    const double term = std::bit_cast<double>(random());
    if (!std::isfinite(term)) continue;
    ASSERT_EQ(sum({term}), term);
  }
  for (const double term : {Limits::max(), Limits::lowest(), Limits::min(), Limits::denorm_min()})
    EXPECT_EQ(sum({term}), term);
}

TEST(ExactSum, KnowsInfinityAndNoNumber) {
  EXPECT_EQ(sum({Limits::infinity(), -1e308}), Limits::infinity());
  EXPECT_EQ(sum({-Limits::infinity(), 1}), -Limits::infinity());
  EXPECT_TRUE(std::isnan(sum({Limits::infinity(), -Limits::infinity()})));
  EXPECT_TRUE(std::isnan(sum({Limits::quiet_NaN(), 1})));
  EXPECT_EQ(sum({Limits::max(), Limits::max()}), Limits::infinity());
  EXPECT_EQ(sum({Limits::max(), Limits::max(), Limits::lowest()}), Limits::max());
}

TEST(ExactSum, DoesNotDependOnOrderOrDivision) {
  std::mt19937_64 random(2);
  std::vector<double> terms(3000);
  for (double& term : terms)
    term = std::ldexp(std::uniform_real_distribution(-1.0, 1.0)(random), static_cast<int>(random() % 400) - 200);
  const double all = sum(terms);
  for (int i = 0; i < 10; ++i) {
    std::ranges::shuffle(terms, random);
    const auto cut = static_cast<std::ptrdiff_t>(random() % terms.size());
    ExactSum parts = exact_sum({terms.begin(), terms.begin() + cut});
    parts.add(exact_sum({terms.begin() + cut, terms.end()}));
    EXPECT_EQ(parts.value(), all);
    EXPECT_EQ(sum(terms), all);
  }
  // A plain sum in long double comes near it, a sum that dropped a limb would not.
  long double plain = 0;
  for (const double term : terms) plain += term;
  EXPECT_NEAR(static_cast<double>(plain / all), 1, 1e-12);
}

}  // namespace
}  // namespace varimesh
