// The vertex condition on the sphere. A search over the free directions confirms each verdict.
#include "core/diagnosis/vertex_link.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace varimesh::detail {
namespace {

constexpr double kPi = std::numbers::pi;

Vector unit(Vector v) {
  const double length = std::sqrt(dot(v, v));
  for (double& x : v) x /= length;
  return v;
}

LinkDirection fixed(Vector v) { return {unit(v), true}; }
LinkDirection free_direction(Vector v) { return {unit(v), false}; }

/// Three corners: a fence of directions 0, 1 and 2 around one free direction, number 3.
std::vector<LinkCorner> fan() { return {{0, {0, 1, 3, -1}}, {1, {1, 2, 3, -1}}, {2, {2, 0, 3, -1}}}; }

/// The largest value that the smallest determinant of the three corners of fan() can take over all free directions, and
/// the solid angle that the corners fill there.
struct Found {
  double margin, angle;
};
Found search(const Vector& b, const Vector& c, const Vector& d, bool may_wrap) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  Found best{-1, 0};
  for (int i = 0; i < 200000; ++i) {
    const Vector f = unit({normal(random), normal(random), normal(random)});
    const double margin = std::min({determinant(b, c, f), determinant(c, d, f), determinant(d, b, f)});
    if (margin <= best.margin) continue;
    const double angle = solid_angle(b, c, f) + solid_angle(c, d, f) + solid_angle(d, b, f);
    if (may_wrap || angle <= 2 * kPi) best = {margin, angle};
  }
  return best;
}

/// Six boundary directions around a vertex of a smooth surface, with the solid above. The second is tilted by `tilt`.
/// The first three fence in a piece of three corners (free direction 6), the others fence in the rest (free direction
/// 7).
struct Smooth {
  std::vector<LinkDirection> directions;
  std::vector<LinkCorner> corners;
};
Smooth smooth(double tilt) {
  Smooth result;
  for (int i = 0; i < 6; ++i)
    result.directions.push_back(fixed({std::cos(i * kPi / 3), std::sin(i * kPi / 3), i == 1 ? tilt : 0}));
  result.directions.push_back(free_direction({0.4, 0.6, 0.5}));
  result.directions.push_back(free_direction({0, 0, 1}));
  result.corners = {{10, {0, 1, 6, -1}}, {11, {1, 2, 6, -1}}, {12, {2, 0, 6, -1}}, {13, {0, 2, 7, -1}},
                    {14, {2, 3, 7, -1}}, {15, {3, 4, 7, -1}}, {16, {4, 5, 7, -1}}, {17, {5, 0, 7, -1}}};
  return result;
}

TEST(VertexLink, ASolidAngleIsThatOfTheTriangleOrOfAllAroundIt) {
  const Vector x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  EXPECT_NEAR(solid_angle(x, y, z), kPi / 2, 1e-12);
  EXPECT_NEAR(solid_angle(x, z, y), 4 * kPi - kPi / 2, 1e-12);
  const Vector a = unit({-1, std::sqrt(3.0), 0}), b = unit({-1, -std::sqrt(3.0), 0});
  EXPECT_NEAR(solid_angle(x, a, b), 2 * kPi, 1e-12);
}

TEST(VertexLink, ACornerOfACubeIsFine) {
  const LinkDirection directions[] = {fixed({1, 0, 0}), fixed({0, 1, 0}), fixed({0, 0, 1})};
  const LinkCorner corners[] = {{0, {0, 1, 2, -1}}};
  EXPECT_TRUE(link_faults(directions, corners).empty());
}

TEST(VertexLink, OneCellInTheTangentPlaneIsNamed) {
  const LinkDirection directions[] = {fixed({1, 0, 0}), fixed({0, 1, 0}), fixed({-1, -1, 0})};
  const LinkCorner corners[] = {{7, {0, 1, 2, -1}}};
  const auto faults = link_faults(directions, corners);
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NEAR(faults[0].determinant, 0, 1e-12);
}

TEST(VertexLink, OneCellTheWrongWayRoundIsNamed) {
  const LinkDirection directions[] = {fixed({1, 0, 0}), fixed({0, 0, 1}), fixed({0, 1, 0})};
  const LinkCorner corners[] = {{7, {0, 1, 2, -1}}};
  ASSERT_EQ(link_faults(directions, corners).size(), 1U);
}

TEST(VertexLink, TheCornerOfACavityIsFineAlthoughItsDeterminantIsNegative) {
  // All octants but one are solid. Seen from the solid, the three edges go the other way round.
  const std::vector<LinkDirection> directions{fixed({1, 0, 0}), fixed({0, 0, 1}), fixed({0, 1, 0}),
                                              free_direction({-1, -1, -1})};
  ASSERT_LT(determinant(directions[0].unit, directions[1].unit, directions[2].unit), 0);
  EXPECT_TRUE(link_faults(directions, fan()).empty());
  // There is a free direction that makes all three corners positive. They fill 7/8 of the sphere.
  const Found found = search(directions[0].unit, directions[1].unit, directions[2].unit, true);
  EXPECT_GT(found.margin, 0.5);
  EXPECT_NEAR(found.angle, 3.5 * kPi, 1e-6);
}

TEST(VertexLink, AnyConcaveVertexIsFine) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.35, 0.35);
  for (int i = 0; i < 100; ++i) {
    // Three directions near the axes, in the cavity's order.
    const std::vector<LinkDirection> directions{
        fixed({1, uniform(random), uniform(random)}), fixed({uniform(random), uniform(random), 1}),
        fixed({uniform(random), 1, uniform(random)}), free_direction({-1, -1, -1})};
    EXPECT_TRUE(link_faults(directions, fan()).empty());
  }
}

TEST(VertexLink, OnASmoothSurfaceTheSignOfATinyDeterminantDecides) {
  for (const double tilt : {-0.2, -0.01, -1e-5}) {
    const Smooth good = smooth(tilt), bad = smooth(-tilt);
    EXPECT_TRUE(link_faults(good.directions, good.corners).empty()) << tilt;
    const auto faults = link_faults(bad.directions, bad.corners);
    ASSERT_EQ(faults.size(), 1U) << tilt;
    EXPECT_EQ(faults[0].corners, (std::vector<std::int32_t>{0, 1, 2}));
    EXPECT_LT(faults[0].determinant, 0);
    EXPECT_GT(faults[0].angle, 3.9 * kPi * (1 - 0.2));
    EXPECT_LT(faults[0].room, 2.5 * kPi);
    // A free direction helps only by going around the whole vertex.
    const auto& d = bad.directions;
    EXPECT_LE(search(d[0].unit, d[1].unit, d[2].unit, false).margin, 0);
    const auto& g = good.directions;
    if (tilt < -0.001) {
      EXPECT_GT(search(g[0].unit, g[1].unit, g[2].unit, false).margin, 0);
    }
  }
}

TEST(VertexLink, APieceWithAFlatFenceIsNamed) {
  const Smooth flat = smooth(0);
  const auto faults = link_faults(flat.directions, flat.corners);
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_EQ(faults[0].corners.size(), 3U);
}

/// The largest value that the smallest determinant of these corners can take over all free directions, and the solid
/// angle that the corners fill there. The free direction is the last of three in each corner.
Found search(const std::vector<LinkDirection>& directions, const std::vector<LinkCorner>& corners, double most_angle) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  Found best{-1, 0};
  for (int i = 0; i < 100000; ++i) {
    const Vector f = unit({normal(random), normal(random), normal(random)});
    double margin = 1, angle = 0;
    for (const LinkCorner& corner : corners) {
      const Vector& b = directions[corner.direction[0]].unit;
      const Vector& c = directions[corner.direction[1]].unit;
      margin = std::min(margin, determinant(b, c, f));
      angle += solid_angle(b, c, f);
    }
    if (margin > best.margin && angle <= most_angle) best = {margin, angle};
  }
  return best;
}

TEST(VertexLink, AFreeEdgeNeededOnOppositeSidesByTwoFixedPairsIsNamed) {
  // Around the free direction 4, the pairs (0, 1) and (3, 2) span one plane. One needs it above, the other below.
  const std::vector<LinkDirection> directions{fixed({1, 0, 0}),
                                              fixed({0, 1, 0}),
                                              fixed({-1, 0.2, 0}),
                                              fixed({-0.2, 1, 0}),
                                              free_direction({0.1, 0.2, 1}),
                                              free_direction({0, 0, -1})};
  const std::vector<LinkCorner> opposed{{0, {0, 1, 4, -1}}, {1, {2, 3, 4, -1}}, {2, {1, 2, 5, -1}}};
  const auto faults = link_faults(directions, opposed);
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_EQ(faults[0].free_direction, 4);
  EXPECT_EQ(faults[0].corners, (std::vector<std::int32_t>{0, 1}));
  EXPECT_LE(faults[0].determinant, 1e-9);
  EXPECT_LE(search(directions, {opposed[0], opposed[1]}, 4 * kPi).margin, 1e-9);
}

TEST(VertexLink, AFreeEdgeWithRoomIsFine) {
  const std::vector<LinkDirection> directions{fixed({1, 0, 0}), fixed({0, 1, 0}), fixed({-1, 0.2, 0.3}),
                                              fixed({0.2, -1, 0}), free_direction({0.1, 0.2, -1})};
  const std::vector<LinkCorner> corners{{0, {0, 1, 4, -1}}, {1, {1, 2, 4, -1}}, {2, {2, 3, 4, -1}}, {3, {3, 0, 4, -1}}};
  ASSERT_GT(search(directions, corners, 4 * kPi).margin, 0.05);
  for (const LinkFault& fault : link_faults(directions, corners)) EXPECT_LT(fault.free_direction, 0);
}

TEST(VertexLink, AFenceOfFourCountsLikeOneOfThree) {
  // Eight boundary directions around a vertex of a smooth surface, with the solid above. The first four fence in a
  // piece of four corners. The inner two of them are tilted.
  for (const double tilt : {-0.2, -0.05, -0.01, 0.01, 0.05, 0.2}) {
    std::vector<LinkDirection> directions;
    for (int i = 0; i < 8; ++i)
      directions.push_back(fixed({std::cos(i * kPi / 4), std::sin(i * kPi / 4), i == 1 || i == 2 ? tilt : 0}));
    directions.push_back(free_direction({0.4, 0.6, 0.5}));
    directions.push_back(free_direction({0, 0, 1}));
    std::vector<LinkCorner> corners{{10, {0, 1, 8, -1}}, {11, {1, 2, 8, -1}}, {12, {2, 3, 8, -1}}, {13, {3, 0, 8, -1}}};
    const std::vector<LinkCorner> piece = corners;
    corners.push_back({14, {0, 3, 9, -1}});
    for (int i = 3; i < 8; ++i) corners.push_back({11 + i, {i, (i + 1) % 8, 9, -1}});
    const auto faults = link_faults(directions, corners);
    // Roughly within the half space that the solid fills.
    const bool possible = search(directions, piece, 3 * kPi).margin > 0;
    EXPECT_EQ(possible, tilt < 0) << tilt;
    ASSERT_EQ(faults.size(), possible ? 0U : 1U) << tilt;
    if (possible) continue;
    EXPECT_EQ(faults[0].corners, (std::vector<std::int32_t>{0, 1, 2, 3}));
    EXPECT_GT(faults[0].angle, 3 * kPi);
  }
}

TEST(VertexLink, APieceThatFillsHalfTheSphereIsFine) {
  // Three boundary edges in one plane at 120°: the determinant is 0, and the whole solid angle of 2π is available.
  const std::vector<LinkDirection> directions{fixed({1, 0, 0}), fixed({-0.5, std::sqrt(0.75), 0}),
                                              fixed({-0.5, -std::sqrt(0.75), 0}), free_direction({0, 0, 1})};
  EXPECT_TRUE(link_faults(directions, fan()).empty());
}

}  // namespace
}  // namespace varimesh::detail
