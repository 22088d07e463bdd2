#include "core/geometry/analytic.h"

#include <numbers>

#include "tests/core/geometry/conformance.h"

namespace varimesh::geometry {
namespace {

constexpr double kPi = std::numbers::pi;

/// A frame that is parallel to no axis and far from the origin.
Frame frame() {
  Frame frame;
  frame.origin = {3, -2, 1};
  frame.axes = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  return frame;
}

struct NamedCurve {
  const char* name;
  std::shared_ptr<const CurveShape> shape;
};
struct NamedSurface {
  const char* name;
  std::shared_ptr<const SurfaceShape> shape;
};
template <class Case>
std::string name_of(const testing::TestParamInfo<Case>& info) {
  return info.param.name;
}

class AnalyticCurve : public testing::TestWithParam<NamedCurve> {};

TEST_P(AnalyticCurve, HasDerivativesThatAgreeWithDifferences) { check_derivatives(*GetParam().shape, 4); }
TEST_P(AnalyticCurve, FindsClosestPoints) { check_closest_points(*GetParam().shape, 4); }

INSTANTIATE_TEST_SUITE_P(All, AnalyticCurve,
                         testing::Values(NamedCurve{"line", line({1, 2, 3}, {4, 3, 1})},
                                         NamedCurve{"circle", circle(frame(), 2)}),
                         name_of<NamedCurve>);

class AnalyticSurface : public testing::TestWithParam<NamedSurface> {};

TEST_P(AnalyticSurface, HasDerivativesThatAgreeWithDifferences) { check_derivatives(*GetParam().shape, 4); }
TEST_P(AnalyticSurface, FindsClosestPoints) { check_closest_points(*GetParam().shape, 4); }
TEST_P(AnalyticSurface, GoesOnPastSeams) { check_seams(*GetParam().shape, 4); }
TEST_P(AnalyticSurface, IsScaledAsAWhole) {
  Geometry geometry;
  geometry.surfaces.push_back({1, GetParam().shape, {}});
  const Geometry larger = scaled(geometry, 25.4);
  EXPECT_NEAR(size(larger), 25.4 * size(geometry), 1e-9);
  check_derivatives(*larger.surfaces[0].shape, 4 * 25.4);
  check_closest_points(*larger.surfaces[0].shape, 4 * 25.4);
}

INSTANTIATE_TEST_SUITE_P(All, AnalyticSurface,
                         testing::Values(NamedSurface{"plane", plane(frame(), 3, 2)},
                                         NamedSurface{"cylinder", cylinder(frame(), 1.5, 3)},
                                         NamedSurface{"cone", cone(frame(), 0.5, 0.4, 3)},
                                         NamedSurface{"sphere", sphere(frame(), 2)},
                                         NamedSurface{"torus", torus(frame(), 2, 0.6)}),
                         name_of<NamedSurface>);

TEST(Normal, IsZeroAtAPole) {
  const auto ball = sphere(frame(), 2);
  EXPECT_EQ(ball->at(1, kPi / 2).normal(), Eigen::Vector3d::Zero());
  EXPECT_NEAR(ball->at(1, kPi / 2 - 1e-3).normal().norm(), 1, 1e-12);
}

TEST(ClosestPoint, ReachesAPole) {
  const auto ball = sphere(frame(), 2);
  const Eigen::Vector3d pole = ball->at(0, kPi / 2).x;
  EXPECT_LT(SurfaceSearch(*ball).closest(pole).distance, 1e-7);
}

TEST(ClosestPoint, StopsAtTheEndOfARange) {
  const auto straight = line({0, 0, 0}, {1, 0, 0});
  const CurveFoot foot = CurveSearch(*straight).closest({3, 4, 0});
  EXPECT_EQ(foot.t, 1);
  EXPECT_NEAR(foot.distance, std::sqrt(20.0), 1e-14);
  const auto flat = plane({}, 1, 1);
  EXPECT_NEAR(SurfaceSearch(*flat).closest({3, 0.5, 0}).distance, 2, 1e-14);
  EXPECT_FALSE(flat->contains(1.1, 0.5));
  EXPECT_TRUE(flat->contains(1, 0.5));
}

TEST(ClosestPoint, IsNeverFartherThanTheGuess) {
  const auto ring = torus(frame(), 2, 0.6);
  const Eigen::Vector3d point = frame().origin;  // the centre is equally far from a whole circle
  for (const double v : {0.1, 1.0, 2.5, 4.0})
    EXPECT_LE(closest_from(*ring, point, 0.3, v).distance, (ring->at(0.3, v).x - point).norm());
}

}  // namespace
}  // namespace varimesh::geometry
