// Polygons with holes, gaps, and sides that lie along the rays or end on them.
#include "core/opencascade/outline.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace varimesh::cad {
namespace {

using Point = Outline::Point;
constexpr double kBand = 1e-6;

std::vector<Point> circle(const Point& centre, double radius, int sides) {
  std::vector<Point> line;
  for (int k = 0; k <= sides; ++k) {
    const double angle = 2 * std::numbers::pi * k / sides;
    line.push_back({centre[0] + radius * std::cos(angle), centre[1] + radius * std::sin(angle)});
  }
  return line;
}

/// Each side of the unit square as a line of its own, with ends that miss each other by `gap`.
void add_square(double gap, Outline& outline) {
  const auto add = [&](Point from, Point to) {
    const std::vector<Point> line{from, to};
    outline.add(line);
  };
  add({0, 0}, {1, 0});
  add({1 + gap, gap}, {1, 1});
  add({0, 1}, {1, 1 - gap});  // against the sense of the others
  add({gap, 1 + gap}, {0, gap});
}

TEST(Outline, KnowsTheInsideOfASquareWithAHole) {
  Outline outline({kBand, kBand});
  add_square(0, outline);
  outline.add(circle({0.5, 0.5}, 0.25, 400));
  ASSERT_TRUE(outline.finish());
  std::mt19937 random(7);
  std::uniform_real_distribution<double> anywhere(-0.2, 1.2);
  for (int k = 0; k < 20'000; ++k) {
    const Point at{anywhere(random), anywhere(random)};
    const double from_centre = std::hypot(at[0] - 0.5, at[1] - 0.5);
    if (std::abs(from_centre - 0.25) < 1e-4) continue;
    const bool is_inside = at[0] > 0 && at[0] < 1 && at[1] > 0 && at[1] < 1 && from_centre > 0.25;
    ASSERT_EQ(outline.contains(at), std::optional(is_inside)) << at[0] << ' ' << at[1];
  }
}

TEST(Outline, HasNoAnswerNearASide) {
  Outline outline({kBand, 10 * kBand});
  add_square(0, outline);
  ASSERT_TRUE(outline.finish());
  EXPECT_EQ(outline.contains({0.5 * kBand, 0.5}), std::nullopt);
  EXPECT_EQ(outline.contains({-0.5 * kBand, 0.5}), std::nullopt);
  EXPECT_EQ(outline.contains({2 * kBand, 0.5}), std::optional(true));
  EXPECT_EQ(outline.contains({-2 * kBand, 0.5}), std::optional(false));
  EXPECT_EQ(outline.contains({0.5, 9 * kBand}), std::nullopt);
  EXPECT_EQ(outline.contains({0.5, -9 * kBand}), std::nullopt);
  EXPECT_EQ(outline.contains({0.5, 11 * kBand}), std::optional(true));
  EXPECT_EQ(outline.contains({0.5, -11 * kBand}), std::optional(false));
}

// The rays of these points run along sides or through corners.
TEST(Outline, CountsCornersOnce) {
  Outline outline({kBand, kBand});
  const std::vector<Point> star{{0, 0.5}, {0.3, 0.5}, {0.5, 0}, {0.7, 0.5}, {1, 0.5}, {0.5, 1}, {0, 0.5}};
  outline.add(star);
  ASSERT_TRUE(outline.finish());
  EXPECT_EQ(outline.contains({-0.1, 0.5}), std::optional(false));
  EXPECT_EQ(outline.contains({0.5, 0.5}), std::optional(true));
  EXPECT_EQ(outline.contains({1.1, 0.5}), std::optional(false));
  EXPECT_EQ(outline.contains({0.2, 0.4}), std::optional(false));
  EXPECT_EQ(outline.contains({0.4, 1}), std::optional(false));
  EXPECT_EQ(outline.contains({0.4, 0}), std::optional(false));
}

TEST(Outline, JoinsLinesWhoseEndsNearlyMeet) {
  Outline outline({kBand, kBand});
  add_square(0.5 * kBand, outline);
  ASSERT_TRUE(outline.finish());
  for (const double y : {0.25, 0.5, 0.75, 1e-5, 1 - 1e-5}) {
    EXPECT_EQ(outline.contains({0.5, y}), std::optional(true)) << y;
    EXPECT_EQ(outline.contains({-0.5, y}), std::optional(false)) << y;
    EXPECT_EQ(outline.contains({1.5, y}), std::optional(false)) << y;
  }
}

// Two gaps at one height would leave an even number of sides.
TEST(Outline, IsRefusedIfALineIsOpen) {
  Outline outline({kBand, kBand});
  const std::vector<Point> left{{0, 0.6}, {0, 1}, {1, 1}, {1, 0.6}}, right{{1, 0.4}, {1, 0}, {0, 0}, {0, 0.4}};
  outline.add(left);
  outline.add(right);
  EXPECT_FALSE(outline.finish());
}

TEST(Outline, IsRefusedIfItIsEmpty) {
  Outline outline({kBand, kBand});
  EXPECT_FALSE(outline.finish());
}

}  // namespace
}  // namespace varimesh::cad
