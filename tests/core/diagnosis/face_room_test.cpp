// The room of faces for which it is known, and that it is what its definition says.
#include <gtest/gtest.h>

#include <cmath>

#include "core/diagnosis/fixed_samples.h"

namespace varimesh::detail {
namespace {

Eigen::MatrixXd rows(std::initializer_list<std::initializer_list<double>> values) {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(values.size()), static_cast<Eigen::Index>(values.begin()->size()));
  Eigen::Index i = 0;
  for (const auto& row : values) {
    Eigen::Index j = 0;
    for (const double value : row) matrix(i, j++) = value;
    ++i;
  }
  return matrix;
}

TEST(BernsteinOnTriangle, AddUpToOneAndAreOneAtTheVertices) {
  const Eigen::MatrixXd points = rows({{-1, -1}, {1, -1}, {-1, 1}, {-0.3, -0.2}});
  for (int degree = 0; degree <= 3; ++degree) {
    const Eigen::MatrixXd values = bernstein_on_triangle(degree, points);
    EXPECT_EQ(values.cols(), (degree + 1) * (degree + 2) / 2);
    EXPECT_NEAR((values.rowwise().sum().array() - 1).abs().maxCoeff(), 0, 1e-14);
    EXPECT_NEAR((values.topRows(3).rowwise().maxCoeff().array() - 1).abs().maxCoeff(), 0, 1e-14);
    EXPECT_GE(values.minCoeff(), 0);
  }
}

TEST(FaceRoom, IsOneForAFlatFace) {
  // With few points a field may be larger at all of them.
  constexpr int kIntervals = 8;
  Eigen::MatrixXd points((kIntervals + 1) * (kIntervals + 2) / 2, 2);
  Eigen::Index row = 0;
  for (int i = 0; i <= kIntervals; ++i)
    for (int j = 0; i + j <= kIntervals; ++j)
      points.row(row++) = Eigen::RowVector2d(2.0 * i / kIntervals - 1, 2.0 * j / kIntervals - 1);
  Eigen::MatrixXd normals(points.rows(), 3);
  normals.rowwise() = Eigen::RowVector3d(0.6, 0, 0.8);
  for (int degree = 0; degree <= 3; ++degree)
    EXPECT_NEAR(face_room(bernstein_on_triangle(degree, points), normals, 2), 1, 0.01) << degree;
}

TEST(FaceRoom, IsOneIfEveryCoefficientCanFollowItsOwnNormal) {
  const Eigen::MatrixXd points = rows({{-1, -1}, {1, -1}, {-1, 1}});
  EXPECT_NEAR(face_room(bernstein_on_triangle(1, points), rows({{1, 0, 0}, {-1, 0, 0}, {0, 0, 1}}), 2), 1, 1e-3);
}

TEST(FaceRoom, IsNoneIfNoFieldIsOnTheRightSide) {
  // A linear field that is positive at two vertices is positive between them.
  const Eigen::MatrixXd points = rows({{-1, -1}, {1, -1}, {0, -1}});
  const Eigen::MatrixXd linear = bernstein_on_triangle(1, points);
  EXPECT_NEAR(face_room(linear, rows({{0, 0, 1}, {0, 0, 1}, {0, 0, -1}}), 2), 0, 1e-3);
  // The middle may turn to the side, but no further.
  const double s = std::sqrt(0.5);
  EXPECT_GT(face_room(linear, rows({{0, 0, 1}, {0, 0, 1}, {s, 0, -s}}), 2), 0.3);
  EXPECT_LT(face_room(linear, rows({{0, 0, 1}, {0, 0, 1}, {0.1, 0, -0.995}}), 2), 0.1);
}

TEST(FaceRoom, EndsOnceItIsEnough) {
  const Eigen::MatrixXd points = rows({{-1, -1}, {1, -1}, {-1, 1}, {0, 0}});
  Eigen::MatrixXd normals(points.rows(), 3);
  normals.rowwise() = Eigen::RowVector3d(0, 1, 0);
  const double room = face_room(bernstein_on_triangle(2, points), normals, 0.3);
  EXPECT_GT(room, 0.3);
  EXPECT_LE(room, 1 + 1e-12);
}

}  // namespace
}  // namespace varimesh::detail
