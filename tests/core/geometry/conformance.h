// What every implementation of a curve or surface must fulfil. The tests of each implementation call these functions.
#pragma once

#include <gtest/gtest.h>

#include <cmath>

#include "core/geometry/closest_point.h"

namespace varimesh::geometry {

/// Places strictly inside a range, so that central differences stay inside.
inline std::vector<double> places_inside(const Range& range, int count = 7) {
  std::vector<double> places;
  for (int i = 0; i < count; ++i) places.push_back(range.first + range.length() * (i + 0.37) / count);
  return places;
}

/// For surfaces in pieces, of which many are between the places of an ordinary test: the places per direction.
inline constexpr int kInPieces = 61;

/// Whether the surface is defined around these parameters.
inline bool has_room(const SurfaceShape& surface, double u, double v, double h) {
  return surface.contains(u - h, v) && surface.contains(u + h, v) && surface.contains(u, v - h) &&
         surface.contains(u, v + h);
}

/// First and second derivatives agree with central differences. `size` is the size of the curve.
inline void check_derivatives(const CurveShape& curve, double size) {
  const double h = 1e-5 * curve.range().length();
  for (const double t : places_inside(curve.range())) {
    const CurvePoint p = curve.at(t), before = curve.at(t - h), after = curve.at(t + h);
    const double scale = size / curve.range().length();
    EXPECT_LT(((after.x - before.x) / (2 * h) - p.dt).norm(), 1e-6 * scale) << "t = " << t;
    EXPECT_LT(((after.dt - before.dt) / (2 * h) - p.dtt).norm(), 1e-5 * scale / curve.range().length()) << "t = " << t;
  }
}

inline void check_derivatives(const SurfaceShape& surface, double size, int places = 7) {
  const Range ru = surface.u_range();
  const Range rv = surface.v_range();
  const bool in_pieces = surface.pieces() != nullptr;
  const double length = in_pieces ? rv.length() : ru.length();
  const double hu = 1e-5 * length, hv = 1e-5 * rv.length();
  const double su = size / length, sv = size / rv.length();
  int tested = 0;
  for (const double u : places_inside(ru, places))
    for (const double v : places_inside(rv)) {
      if (in_pieces && !has_room(surface, u, v, hu)) continue;
      ++tested;
      const SurfacePoint p = surface.at(u, v);
      const SurfacePoint left = surface.at(u - hu, v), right = surface.at(u + hu, v);
      const SurfacePoint low = surface.at(u, v - hv), high = surface.at(u, v + hv);
      EXPECT_LT(((right.x - left.x) / (2 * hu) - p.du).norm(), 1e-6 * su) << u << ", " << v;
      EXPECT_LT(((high.x - low.x) / (2 * hv) - p.dv).norm(), 1e-6 * sv) << u << ", " << v;
      EXPECT_LT(((right.du - left.du) / (2 * hu) - p.duu).norm(), 1e-5 * su / length) << u << ", " << v;
      EXPECT_LT(((right.dv - left.dv) / (2 * hu) - p.duv).norm(), 1e-5 * su / rv.length()) << u << ", " << v;
      EXPECT_LT(((high.dv - low.dv) / (2 * hv) - p.dvv).norm(), 1e-5 * sv / rv.length()) << u << ", " << v;
    }
  EXPECT_GE(tested, 20);
}

/// The foot of a point of the shape is the point itself; the foot of a point a little off the shape is where it left
/// it.
inline void check_closest_points(const CurveShape& curve, double size) {
  const CurveSearch search(curve);
  for (const double t : places_inside(curve.range())) {
    const CurvePoint p = curve.at(t);
    EXPECT_LT(search.closest(p.x).distance, 1e-13 * size) << "t = " << t;
    const Eigen::Vector3d across = p.dt.unitOrthogonal();
    const CurveFoot foot = search.closest(p.x + 1e-3 * size * across);
    EXPECT_LT((foot.x - p.x).norm(), 1e-8 * size) << "t = " << t;
    EXPECT_NEAR(foot.distance, 1e-3 * size, 1e-11 * size);
    EXPECT_LT((curve.at(foot.t).x - foot.x).norm(), 1e-15 * size);
  }
}

inline void check_closest_points(const SurfaceShape& surface, double size, int places = 7) {
  const SurfaceSearch search(surface);
  for (const double u : places_inside(surface.u_range(), places))
    for (const double v : places_inside(surface.v_range())) {
      // Past a joint of pieces the foot may be elsewhere, because normals jump there.
      if (surface.pieces() != nullptr && !has_room(surface, u, v, 0.02)) continue;
      const SurfacePoint p = surface.at(u, v);
      EXPECT_LT(search.closest(p.x).distance, 1e-13 * size) << u << ", " << v;
      const SurfaceFoot foot = search.closest(p.x + 1e-3 * size * p.normal());
      EXPECT_LT((foot.x - p.x).norm(), 1e-8 * size) << u << ", " << v;
      EXPECT_NEAR(foot.distance, 1e-3 * size, 1e-11 * size);
      const SurfaceFoot again = closest_from(surface, p.x, foot.u, foot.v);
      EXPECT_LT(again.distance, 1e-13 * size);
    }
}

/// A periodic parameter goes on past its end, and a foot found from a guess beyond the seam is the same point.
inline void check_seams(const SurfaceShape& surface, double size) {
  const Range ru = surface.u_range(), rv = surface.v_range();
  for (const double s : {0.1, 0.6}) {
    const double u = ru.first + s * ru.length(), v = rv.first + s * rv.length();
    if (ru.period > 0) {
      EXPECT_LT((surface.at(u, v).x - surface.at(u + ru.period, v).x).norm(), 1e-12 * size);
      const SurfacePoint beyond = surface.at(ru.first - 0.01 * ru.period, v);
      const SurfaceFoot foot = closest_from(surface, beyond.x, ru.first + 0.01 * ru.period, v);
      EXPECT_LT(foot.distance, 1e-12 * size);
      EXPECT_NEAR(foot.u, ru.first - 0.01 * ru.period, 1e-9 * ru.period);
    }
    if (rv.period > 0) {
      EXPECT_LT((surface.at(u, v).x - surface.at(u, v + rv.period).x).norm(), 1e-12 * size);
    }
  }
}

}  // namespace varimesh::geometry
