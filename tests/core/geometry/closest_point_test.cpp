// Feet of points near poles and seams, against formulas, from guesses on any meridian.
#include "core/geometry/closest_point.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "core/geometry/analytic.h"

namespace varimesh::geometry {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kPoints = 300;

/// Numbers between −1 and 1, the same in every run.
class Numbers {
 public:
  double next() { return between_(random_); }
  Eigen::Vector3d vector() { return {next(), next(), next()}; }

 private:
  std::mt19937_64 random_{11};
  std::uniform_real_distribution<double> between_{-1, 1};
};

TEST(ClosestFrom, PassesThePolesOfASphere) {
  const auto ball = sphere({}, 2);
  Numbers numbers;
  for (int i = 0; i < kPoints; ++i) {
    const double tilt = std::pow(10, -2 + 2 * numbers.next()), turn = kPi * numbers.next();
    const double radius = 2 + 0.2 * numbers.next(), side = i % 2 == 0 ? 1 : -1;
    const Eigen::Vector3d point = radius * Eigen::Vector3d(std::sin(tilt) * std::cos(turn),
                                                           std::sin(tilt) * std::sin(turn), side * std::cos(tilt));
    const double u = kPi * numbers.next(), v = side * (kPi / 2 - std::abs(0.5 * numbers.next()));
    const SurfaceFoot foot = closest_from(*ball, point, u, v);
    EXPECT_NEAR(foot.distance, std::abs(radius - 2), 1e-13) << "from " << u << ", " << v << " to " << point.transpose();
    EXPECT_LT((foot.x - 2 * point.normalized()).norm(), 1e-7);
  }
}

TEST(ClosestFrom, StartsAtAPole) {
  const auto ball = sphere({}, 1);
  for (int i = 0; i < 32; ++i) {
    const double turn = 2 * kPi * i / 32;
    const Eigen::Vector3d point = 1.1 * ball->at(turn, 1.4).x;
    EXPECT_NEAR(closest_from(*ball, point, 0.1, kPi / 2).distance, 0.1, 1e-13);
  }
}

TEST(ClosestFrom, PassesTheTipOfACone) {
  const double half_angle = 0.4;
  const auto hat = cone({}, 0, half_angle, 3);
  Numbers numbers;
  for (int i = 0; i < kPoints; ++i) {
    // A point over the wall, whose foot is `along` from the tip.
    const double along = std::pow(10, -1.5 + numbers.next()), off = 0.05 * along * numbers.next();
    const double turn = kPi * numbers.next();
    const double rho = along * std::sin(half_angle) + off * std::cos(half_angle);
    const Eigen::Vector3d point(rho * std::cos(turn), rho * std::sin(turn),
                                along * std::cos(half_angle) - off * std::sin(half_angle));
    const SurfaceFoot foot = closest_from(*hat, point, kPi * numbers.next(), 0.3 * std::abs(numbers.next()));
    EXPECT_NEAR(foot.distance, std::abs(off), 1e-13) << point.transpose();
  }
}

TEST(ClosestFrom, LeavesPlacesWhereOnlyTheSlopeVanishes) {
  // Exactly opposite the point, the distance to a round surface is largest among its neighbours around the axis.
  const auto hat = cone({}, 0.5, -std::atan(0.5), std::sqrt(1.25));
  const auto pipe = cylinder({}, 1, 2);
  const auto ring = torus({}, 2, 0.7);
  EXPECT_NEAR(closest_from(*pipe, {0.7, 0, 1}, kPi, 1).distance, 0.3, 1e-13);
  EXPECT_NEAR(closest_from(*ring, {2.4, 0, 0}, 0, kPi).distance, 0.3, 1e-13);
  EXPECT_NEAR(closest_from(*ring, {2.4, 0, 0}, kPi, kPi).distance, 0.3, 1e-13);
  const SurfaceSearch search(*hat);
  for (double off = 0.1; off > 1e-6; off /= 2) {
    const SurfacePoint on = hat->at(0, hat->v_range().last - off);
    EXPECT_LT(closest_from(*hat, on.x, kPi, hat->v_range().last - off).distance, 1e-13) << off;
    EXPECT_LT(search.closest(on.x).distance, 1e-13) << off;
  }
}

/// A closed surface whose parameters do not know that it is closed, as a spline's often do not.
class Unrolled : public SurfaceShape {
 public:
  explicit Unrolled(std::shared_ptr<const SurfaceShape> shape) : shape_(std::move(shape)) {}
  SurfacePoint at(double u, double v) const override { return shape_->at(u, v); }
  Range u_range() const override { return {shape_->u_range().first, shape_->u_range().last, 0}; }
  Range v_range() const override { return {shape_->v_range().first, shape_->v_range().last, 0}; }

 private:
  std::shared_ptr<const SurfaceShape> shape_;
};

TEST(ClosestFrom, PassesSeams) {
  const Unrolled pipe(cylinder({}, 1, 2));
  const Unrolled ring(torus({}, 2, 0.7));
  const Unrolled ball(sphere({}, 1));
  Numbers numbers;
  for (int i = 0; i < kPoints; ++i) {
    const double turn = numbers.next(), start = turn > 0 ? 2 * kPi - 0.3 : 0.3;
    const Eigen::Vector3d out(std::cos(turn), std::sin(turn), 0);
    EXPECT_NEAR(closest_from(pipe, 1.2 * out + Eigen::Vector3d(0, 0, 1), start, 0.5).distance, 0.2, 1e-13);
    // Across the seam in v, too.
    const double across = 0.5 * numbers.next(), from = across > 0 ? 2 * kPi - 0.2 : 0.2;
    const Eigen::Vector3d point = (2 + 0.8 * std::cos(across)) * out + Eigen::Vector3d(0, 0, 0.8 * std::sin(across));
    EXPECT_NEAR(closest_from(ring, point, start, from).distance, 0.1, 1e-13);
    const Eigen::Vector3d near_pole = Eigen::Vector3d(0, 0, 1) + 0.3 * numbers.vector();
    EXPECT_NEAR(closest_from(ball, near_pole, start, 1.2).distance, std::abs(near_pole.norm() - 1), 1e-13)
        << near_pole.transpose();
  }
}

}  // namespace
}  // namespace varimesh::geometry
