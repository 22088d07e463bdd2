// Margins that are known by symmetry.
#include "core/diagnosis/link_margin.h"

#include <gtest/gtest.h>

#include <cmath>

namespace varimesh {
namespace {

using detail::determinant;
using detail::dot;
using detail::LinkCorner;
using detail::LinkDirection;
using detail::LinkPiece;
using detail::Vector;

constexpr double kEnough = 0.08;

Vector unit(Vector x) {
  const double length = std::sqrt(dot(x, x));
  for (double& c : x) c /= length;
  return x;
}

/// Fixed directions around the z axis, h high, and a free one at `start`.
std::vector<LinkDirection> cone(int count, double h, const Vector& start) {
  std::vector<LinkDirection> directions;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * M_PI * i / count;
    directions.push_back({unit({std::cos(angle), std::sin(angle), h}), true});
  }
  directions.push_back({unit(start), false});
  return directions;
}

std::vector<LinkCorner> fan(std::int32_t count) {
  std::vector<LinkCorner> corners;
  for (std::int32_t i = 0; i < count; ++i) corners.push_back({i, {i, (i + 1) % count, count, -1}});
  return corners;
}

TEST(LinkPieces, TurnsTheFreeDirectionToTheMiddle) {
  const auto directions = cone(5, 0.7, {0.9, 0.3, 0.4});
  const std::vector<LinkPiece> pieces = detail::link_pieces(directions, fan(5), kEnough);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_EQ(pieces[0].corners.size(), 5u);
  EXPECT_EQ(pieces[0].fence.size(), 5u);
  // All corners are alike when it points along the axis.
  const double best = determinant(directions[0].unit, directions[1].unit, {0, 0, 1});
  EXPECT_NEAR(pieces[0].margin, best, 1e-9);
}

TEST(LinkPieces, IsTheDeterminantOfAFenceOfThree) {
  const auto directions = cone(3, 0.02, {0, 0, 1});
  const std::vector<LinkPiece> pieces = detail::link_pieces(directions, fan(3), kEnough);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_NEAR(pieces[0].margin, determinant(directions[0].unit, directions[1].unit, directions[2].unit), 1e-12);
  EXPECT_LT(pieces[0].margin, 0.06);
}

TEST(LinkPieces, FindsNoRoomAroundAFoldedFence) {
  // The fourth direction lies on the wrong side of its neighbours.
  auto directions = cone(4, 0.5, {0, 0, 1});
  directions[3].unit = unit({0.9, 0.1, 0.5});
  directions[0].unit = unit({0.2, -0.9, 0.5});
  const std::vector<LinkPiece> pieces = detail::link_pieces(directions, fan(4), kEnough);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_LE(pieces[0].margin, 0);
}

}  // namespace
}  // namespace varimesh
