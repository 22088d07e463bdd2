// Compares polynomials between knots with OpenCASCADE's points and derivatives.
#include "core/opencascade/spline_patches.h"

#include <gtest/gtest.h>

#include <GeomConvert.hxx>
#include <Geom_ToroidalSurface.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <random>
#include <thread>

#include "core/opencascade/shapes.h"

namespace varimesh::cad {
namespace {

using Surface = Handle(Geom_BSplineSurface);

/// A wavy surface over knots at uneven distances, with a double one.
Surface wavy(int u_degree, int v_degree) {
  TColStd_Array1OfReal knots(1, 5);
  TColStd_Array1OfInteger u_times(1, 5), v_times(1, 5);
  const double values[] = {-1, 0, 0.2, 3, 4};
  for (int k = 1; k <= 5; ++k) {
    knots(k) = values[k - 1];
    u_times(k) = k == 1 || k == 5 ? u_degree + 1 : k == 3 ? std::min(2, u_degree) : 1;
    v_times(k) = k == 1 || k == 5 ? v_degree + 1 : 1;
  }
  int rows = -u_degree - 1, columns = -v_degree - 1;
  for (int k = 1; k <= 5; ++k) {
    rows += u_times(k);
    columns += v_times(k);
  }
  TColgp_Array2OfPnt poles(1, rows, 1, columns);
  for (int i = 1; i <= rows; ++i)
    for (int j = 1; j <= columns; ++j) poles(i, j) = gp_Pnt(i + 0.2 * std::sin(j), j, std::sin(i) * std::cos(j));
  return new Geom_BSplineSurface(poles, knots, knots, u_times, v_times, u_degree, v_degree);
}

/// A torus as a rational surface that is periodic in both directions, with the parameters of a circle.
Surface torus() {
  const Handle(Geom_ToroidalSurface) torus = new Geom_ToroidalSurface(gp_Ax3(), 2, 0.5);
  return GeomConvert::SurfaceToBSplineSurface(torus);
}

/// A wavy tube that is not rational, periodic in v.
Surface tube() {
  TColStd_Array1OfReal u_knots(1, 2), v_knots(1, 7);
  TColStd_Array1OfInteger u_times(1, 2), v_times(1, 7);
  for (int k = 1; k <= 2; ++k) {
    u_knots(k) = k;
    u_times(k) = 3;
  }
  for (int k = 1; k <= 7; ++k) {
    v_knots(k) = k + 0.1 * std::sin(k);
    v_times(k) = 1;
  }
  TColgp_Array2OfPnt poles(1, 3, 1, 6);
  for (int i = 1; i <= 3; ++i)
    for (int j = 1; j <= 6; ++j) poles(i, j) = gp_Pnt(std::cos(1.05 * j), std::sin(1.05 * j) + 0.1 * i, i);
  return new Geom_BSplineSurface(poles, u_knots, v_knots, u_times, v_times, 2, 3, false, true);
}

void expect_equal(const Surface& surface, double beyond) {
  const auto patches = SplinePatches::make(surface);
  ASSERT_NE(patches, nullptr);
  double u0 = 0, u1 = 0, v0 = 0, v1 = 0;
  surface->Bounds(u0, u1, v0, v1);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> part(-beyond, 1 + beyond);
  for (int k = 0; k < 5'000; ++k) {
    const double u = u0 + part(random) * (u1 - u0), v = v0 + part(random) * (v1 - v0);
    gp_Pnt x;
    gp_Vec du, dv, duu, dvv, duv;
    surface->D2(u, v, x, du, dv, duu, dvv, duv);
    const geometry::SurfacePoint p = patches->at(u, v);
    const auto expect_near = [&](const Eigen::Vector3d& ours, const gp_XYZ& theirs, double tolerance) {
      ASSERT_LT((ours - vector(theirs)).norm(), tolerance * (1 + theirs.Modulus())) << u << ' ' << v;
    };
    expect_near(p.x, x.XYZ(), 1e-14);
    expect_near(p.du, du.XYZ(), 1e-12);
    expect_near(p.dv, dv.XYZ(), 1e-12);
    expect_near(p.duu, duu.XYZ(), 1e-10);
    expect_near(p.duv, duv.XYZ(), 1e-10);
    expect_near(p.dvv, dvv.XYZ(), 1e-10);
  }
}

TEST(SplinePatches, AreThePolynomialsBetweenUnevenKnots) {
  expect_equal(wavy(3, 2), 0);
  expect_equal(wavy(1, 5), 0);
}

TEST(SplinePatches, AreRationalAndPeriodic) {
  ASSERT_TRUE(torus()->IsUPeriodic() && torus()->IsVPeriodic() && torus()->IsURational());
  expect_equal(torus(), 1.5);
}

TEST(SplinePatches, ArePeriodicWithoutWeights) {
  ASSERT_TRUE(tube()->IsVPeriodic() && !tube()->IsVRational());
  expect_equal(tube(), 0);
  const auto patches = SplinePatches::make(tube());
  const double period = tube()->VPeriod();
  EXPECT_LT((patches->at(1.3, 2.2).x - patches->at(1.3, 2.2 + 2 * period).x).norm(), 1e-14);
}

TEST(SplinePatches, GoOnBeyondTheBounds) { expect_equal(wavy(3, 3), 0.05); }

TEST(SplinePatches, AreNotMadeOfHighDegrees) {
  const Surface surface = wavy(3, 3);
  surface->IncreaseDegree(12, 3);
  EXPECT_EQ(SplinePatches::make(surface), nullptr);
}

TEST(SplinePatches, ThreadsMayShareThem) {
  const auto shared = SplinePatches::make(wavy(3, 3)), own = SplinePatches::make(wavy(3, 3));
  const auto sum = [](const SplinePatches& patches) {
    double sum = 0;
    for (int i = 0; i < 100; ++i)
      for (int j = 0; j < 100; ++j) sum += patches.at(-1 + 0.05 * i, -1 + 0.05 * j).x.sum();
    return sum;
  };
  std::array<double, 4> sums{};
  std::vector<std::thread> threads;
  for (double& each : sums) threads.emplace_back([&] { each = sum(*shared); });
  for (std::thread& thread : threads) thread.join();
  const double expected = sum(*own);
  for (const double found : sums) EXPECT_EQ(found, expected);
}

}  // namespace
}  // namespace varimesh::cad
