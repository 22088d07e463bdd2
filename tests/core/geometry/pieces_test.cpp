#include "core/geometry/pieces.h"

#include <algorithm>
#include <map>
#include <numbers>

#include "core/geometry/analytic.h"
#include "core/reference/nodes.h"
#include "tests/core/geometry/conformance.h"

namespace varimesh::geometry {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

/// Which shape elements lie on, and how they meet it.
struct Case {
  const char* name;
  Shape shape;
  int order;
  int columns, rows;
};
std::string name_of(const testing::TestParamInfo<Case>& info) { return info.param.name; }

constexpr double kMajor = 2, kMinor = 0.7;
/// What is most of the distance of a point from the torus.
double off_torus(const Eigen::Vector3d& x) {
  return std::abs(std::hypot(std::hypot(x[0], x[1]) - kMajor, x[2]) - kMinor);
}

/// Elements on a closed torus, which meet at all edges. `uneven` moves the nodes between vertices along the torus.
std::vector<SurfacePiece> torus_pieces(const Case& of, double uneven = 0) {
  const auto shape = torus({}, kMajor, kMinor);
  const int m = of.columns * of.order, n = of.rows * of.order;
  const auto wave = [&](double s, int count) { return s + uneven * std::sin(count * kTurn * s) / (count * kTurn); };
  std::vector<SurfacePiece> pieces;
  const auto add = [&](int i, int j, int side) {
    SurfacePiece piece;
    piece.shape = of.shape;
    const auto& lattice = reference::lattice(of.shape, of.order);
    piece.x.resize(3, static_cast<Eigen::Index>(lattice.size()));
    for (std::size_t k = 0; k < lattice.size(); ++k) {
      int a = i * of.order + lattice[k][0], b = j * of.order + lattice[k][1];
      if (side < 0) {
        a = (i + 1) * of.order - lattice[k][0];
        b = (j + 1) * of.order - lattice[k][1];
      }
      piece.x.col(static_cast<Eigen::Index>(k)) =
          shape->at(kTurn * wave(double(a % m) / m, of.columns), kTurn * wave(double(b % n) / n, of.rows)).x;
      piece.numbers.push_back((a % m) * n + b % n);
    }
    pieces.push_back(std::move(piece));
  };
  for (int i = 0; i < of.columns; ++i)
    for (int j = 0; j < of.rows; ++j) {
      add(i, j, 1);
      if (of.shape == Shape::Triangle) add(i, j, -1);
    }
  return pieces;
}

/// The largest distance of the pieces from the torus.
double true_error(const SurfaceShape& surface) {
  constexpr int kSamples = 12;
  double largest = 0;
  for (double u = 0; u < surface.u_range().last; u += 4)
    for (int i = 0; i <= kSamples; ++i)
      for (int j = 0; j <= kSamples; ++j) {
        const double xi = -1 + 2.0 * i / kSamples, eta = -1 + 2.0 * j / kSamples;
        if (surface.contains(u + xi, eta)) largest = std::max(largest, off_torus(surface.at(u + xi, eta).x));
      }
  return largest;
}

class SurfaceOfPieces : public testing::TestWithParam<Case> {
 protected:
  PieceSurface made_ = surface_of_pieces(torus_pieces(GetParam()), GetParam().order);
  const SurfaceShape& surface_ = *made_.shape;
};

TEST_P(SurfaceOfPieces, HasDerivativesThatAgreeWithDifferences) { check_derivatives(surface_, 5, kInPieces); }
TEST_P(SurfaceOfPieces, FindsClosestPoints) { check_closest_points(surface_, 5, kInPieces); }

TEST_P(SurfaceOfPieces, HasParametersForItsNodes) {
  const auto pieces = torus_pieces(GetParam());
  for (std::size_t k = 0; k < pieces.size(); k += 3)
    for (std::size_t node = 0; node < pieces[k].numbers.size(); ++node) {
      const auto at = parameters_of_node(pieces[k], k, GetParam().order, node);
      EXPECT_TRUE(surface_.contains(at[0], at[1]));
      EXPECT_LT((surface_.at(at[0], at[1]).x - pieces[k].x.col(static_cast<Eigen::Index>(node))).norm(), 1e-13);
    }
}

// From one end of a diagonal through many pieces to the other end: the search passes every joint between them.
TEST_P(SurfaceOfPieces, FindsItsWayThroughPieces) {
  const auto torus_shape = torus({}, kMajor, kMinor);
  SurfaceFoot foot = surface_.pieces()->closest(torus_shape->at(0.01, 0.01).x);
  for (int step = 1; step <= 100; ++step) {
    const Eigen::Vector3d goal = torus_shape->at(0.01 + 0.03 * step, 0.01 + 0.05 * step).x;
    foot = closest_from(surface_, goal, foot.u, foot.v);
    ASSERT_NEAR(foot.distance, surface_.pieces()->closest(goal).distance, 1e-9);
    ASSERT_TRUE(surface_.contains(foot.u, foot.v));
  }
}

TEST_P(SurfaceOfPieces, NeverComesFartherThanTheGuess) {
  for (const double u : {0.1, 4.2, 8.3})
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(3, 1, 1)})
      EXPECT_LE(closest_from(surface_, point, u, -0.4).distance, (surface_.at(u, -0.4).x - point).norm());
}

TEST_P(SurfaceOfPieces, HasNormalsOnTheSideOfTheStraightElement) {
  for (double u = 0; u < surface_.u_range().last; u += 4) {
    const SurfacePoint p = surface_.at(u - 0.3, -0.4);
    EXPECT_NEAR(std::abs(surface_.normal(p, u - 0.3, -0.4).dot(p.normal())), 1, 1e-12);
  }
}

// What the joints show of the error is never too large, and falls with the same order.
TEST_P(SurfaceOfPieces, SeesItsErrorOfInterpolation) {
  for (const double uneven : {0.0, 0.4}) {
    double seen[2], real[2];
    for (int level = 0; level < 2; ++level) {
      Case finer = GetParam();
      finer.columns <<= level;
      finer.rows <<= level;
      const PieceSurface made = surface_of_pieces(torus_pieces(finer, uneven), finer.order);
      seen[level] = made.error.largest;
      real[level] = true_error(*made.shape);
      EXPECT_LE(seen[level], real[level]);
      EXPECT_GE(seen[level], 0.1 * real[level]);
      EXPECT_LE(made.error.rms, made.error.largest);
    }
    if (uneven == 0) {
      EXPECT_GT(std::log2(seen[0] / seen[1]), GetParam().order + 0.5);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, SurfaceOfPieces,
                         testing::Values(Case{"triangles_2", Shape::Triangle, 2, 12, 8},
                                         Case{"triangles_3", Shape::Triangle, 3, 10, 6},
                                         Case{"triangles_5", Shape::Triangle, 5, 8, 5},
                                         Case{"quadrilaterals_2", Shape::Quadrilateral, 2, 12, 8},
                                         Case{"quadrilaterals_4", Shape::Quadrilateral, 4, 8, 5}),
                         name_of);

TEST(SurfaceOfOnePiece, OfAFoldedElementHasNormalsOnOneSide) {
  SurfacePiece piece;
  const reference::Points& at = reference::nodes(Shape::Triangle, 2, reference::NodeSet::Equispaced, 3);
  piece.x = Eigen::Matrix3Xd::Zero(3, at.rows());
  piece.x.topRows(2) = at.transpose();
  piece.x.col(3) << 0, 0.9, 0;  // the middle of the first edge lies across the element
  for (int k = 0; k < 6; ++k) piece.numbers.push_back(k);
  const PieceSurface made = surface_of_pieces({piece}, 2);
  int turned = 0;
  for (const auto& place : {std::array<double, 2>{0, -1}, {-0.9, -0.9}, {-0.5, -0.2}}) {
    const SurfacePoint p = made.shape->at(place[0], place[1]);
    turned += p.normal()[2] < 0 ? 1 : 0;
    EXPECT_NEAR(made.shape->normal(p, place[0], place[1])[2], 1, 1e-12);
  }
  EXPECT_GT(turned, 0);
  EXPECT_EQ(made.error.largest, 0);
}

// ===== Curves =====

std::vector<Eigen::Matrix3Xd> circle_pieces(int count, int order, double turn = kTurn, double rise = 0.1) {
  std::vector<Eigen::Matrix3Xd> pieces;
  for (int k = 0; k < count; ++k) {
    Eigen::Matrix3Xd x(3, order + 1);
    for (int i = 0; i <= order; ++i) {
      const double s =
          turn * (k + static_cast<double>(reference::lattice(Shape::Line, order)[std::size_t(i)][0]) / order) / count;
      x.col(i) << 2 * std::cos(s), 2 * std::sin(s), rise * std::sin(2 * s);
    }
    pieces.push_back(std::move(x));
  }
  return pieces;
}

TEST(CurveOfPieces, ConformsOpenAndClosed) {
  for (const int order : {2, 3, 5})
    for (const bool closed : {false, true}) {
      const PieceCurve made = curve_of_pieces(circle_pieces(10, order, closed ? kTurn : 5), closed);
      check_derivatives(*made.shape, 4);
      check_closest_points(*made.shape, 4);
      EXPECT_EQ(made.shape->range().period > 0, closed);
      ASSERT_EQ(made.t.size(), 11U);
      EXPECT_EQ(made.t.back(), made.shape->range().last);
      for (std::size_t k = 0; k < 10; ++k)
        EXPECT_LT((made.shape->at(made.t[k]).x - circle_pieces(10, order, closed ? kTurn : 5)[k].col(0)).norm(), 1e-14);
    }
}

TEST(CurveOfPieces, GoesOnPastTheEndIfItIsClosed) {
  const PieceCurve made = curve_of_pieces(circle_pieces(10, 3), true);
  const double turn = made.t.back();
  EXPECT_LT((made.shape->at(-0.1).x - made.shape->at(turn - 0.1).x).norm(), 1e-14);
  const CurveFoot foot = closest_from(*made.shape, made.shape->at(turn - 0.1).x, 0.1);
  EXPECT_NEAR(foot.t, -0.1, 1e-9);
}

TEST(CurveOfPieces, SeesItsErrorOfInterpolation) {
  for (const int order : {2, 3, 4}) {
    double seen[2];
    for (const int level : {0, 1}) {
      const PieceCurve made = curve_of_pieces(circle_pieces(8 << level, order, kTurn, 0), true);
      double real = 0;
      for (int i = 0; i < 1000; ++i) {
        const Eigen::Vector3d x = made.shape->at(made.t.back() * i / 1000).x;
        real = std::max(real, std::abs(std::hypot(x[0], x[1]) - 2));
      }
      EXPECT_LE(made.error.largest, real);
      EXPECT_GE(made.error.largest, 0.1 * real);
      seen[level] = made.error.largest;
    }
    EXPECT_GT(std::log2(seen[0] / seen[1]), order + 0.5);
  }
}

}  // namespace
}  // namespace varimesh::geometry
