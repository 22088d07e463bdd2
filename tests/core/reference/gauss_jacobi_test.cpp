// Gauss rules for the weight (1 − x)^a (1 + x)^b.
#include <gtest/gtest.h>

#include <cmath>

#include "core/reference/quadrature.h"

namespace varimesh::reference {
namespace {

TEST(GaussJacobi, MatchesKnownRules) {
  const auto [points, weights] = gauss_jacobi(3, 0, 0);
  EXPECT_NEAR(points[2], std::sqrt(0.6), 1e-15);
  EXPECT_NEAR(weights[1], 8.0 / 9, 1e-15);
  // One point for the weight w = (1 − x)²: the point is ∫ x w / ∫ w = −1/2, and its weight is ∫ w = 8/3.
  const auto [point, weight] = gauss_jacobi(1, 2, 0);
  EXPECT_NEAR(point[0], -0.5, 1e-15);
  EXPECT_NEAR(weight[0], 8.0 / 3, 1e-15);
}

TEST(GaussJacobi, IntegratesHighPowersToTheLastDigits) {
  const auto [points, weights] = gauss_jacobi(20, 1, 0);
  // ∫ (1 − x)^39 (1 − x) dx = 2^41 / 41.
  double sum = 0;
  for (int i = 0; i < 20; ++i) sum += weights[i] * std::pow((1 - points[i]) / 2, 39);
  EXPECT_NEAR(sum, 4.0 / 41, 1e-15);
}

}  // namespace
}  // namespace varimesh::reference
