// A pipe in two halves, which meet smoothly: a geometry and a mesh.
#pragma once

#include <numbers>

#include "core/geometry/analytic.h"
#include "tests/core/support/surface_grid.h"

namespace varimesh::testing {

/// A part of a surface, from u = first to u = last, or with u turned round.
class PartOfSurface : public geometry::SurfaceShape {
 public:
  PartOfSurface(std::shared_ptr<const SurfaceShape> whole, double first, double last, bool backwards)
      : whole_(std::move(whole)), first_(first), last_(last), backwards_(backwards) {}
  geometry::SurfacePoint at(double u, double v) const override {
    geometry::SurfacePoint p = whole_->at(backwards_ ? -u : u, v);
    if (!backwards_) return p;
    p.du = -p.du;
    p.duv = -p.duv;
    return p;
  }
  geometry::Range u_range() const override {
    const double beyond = 0.5 * (last_ - first_);
    if (backwards_) return {-last_, -first_, 0, beyond, beyond};
    return {first_, last_, 0, beyond, beyond};
  }
  geometry::Range v_range() const override { return whole_->v_range(); }

 private:
  std::shared_ptr<const SurfaceShape> whole_;
  double first_, last_;
  bool backwards_;
};

/// A part of a curve.
class PartOfCurve : public geometry::CurveShape {
 public:
  PartOfCurve(std::shared_ptr<const CurveShape> whole, double first, double last)
      : whole_(std::move(whole)), first_(first), last_(last) {}
  geometry::CurvePoint at(double t) const override { return whole_->at(t); }
  geometry::Range range() const override { return {first_, last_}; }

 private:
  std::shared_ptr<const CurveShape> whole_;
  double first_, last_;
};

/// A pipe of radius 1 and height 2. Surface 1 is the half with y > 0, and surface 2 the other, on which u runs the
/// other way. Curves 1 and 2 are the joints at x = 1 and x = −1, curves 3 to 6 the halves of the circles.
inline geometry::Geometry split_pipe() {
  constexpr double kHalf = std::numbers::pi;
  geometry::Geometry pipe;
  geometry::Frame top;
  top.origin = {0, 0, 2};
  for (const double z : {0.0, 2.0})
    for (const double x : {1.0, -1.0}) pipe.vertices.push_back({static_cast<int>(pipe.vertices.size()) + 1, {x, 0, z}});
  const auto add = [&](std::shared_ptr<const geometry::CurveShape> shape, std::vector<int> ends, std::vector<int> of) {
    pipe.curves.push_back({static_cast<int>(pipe.curves.size()) + 1, std::move(shape), std::move(ends), std::move(of)});
  };
  add(geometry::line({1, 0, 0}, {1, 0, 2}), {0, 2}, {0, 1});
  add(geometry::line({-1, 0, 0}, {-1, 0, 2}), {1, 3}, {0, 1});
  for (const auto& [frame, first] : {std::pair{geometry::Frame{}, 0}, std::pair{top, 2}})
    for (int half = 0; half < 2; ++half)
      add(std::make_shared<PartOfCurve>(geometry::circle(frame, 1), half * kHalf, (half + 1) * kHalf),
          {first, first + 1}, {half});
  const auto whole = geometry::cylinder({}, 1, 2);
  pipe.surfaces.push_back({1, std::make_shared<PartOfSurface>(whole, 0, kHalf, false), {0, 1, 2, 4}});
  pipe.surfaces.push_back({2, std::make_shared<PartOfSurface>(whole, kHalf, 2 * kHalf, true), {0, 1, 3, 5}});
  return pipe;
}

/// 6 × 3 quadrilaterals of order 3 on the pipe, three columns on each half, of which the first are the widest. `wave`
/// moves the nodes between vertices along the circles.
inline HighOrderMesh split_pipe_mesh(double wave) {
  constexpr double kTurn = 2 * std::numbers::pi;
  HighOrderMesh mesh = surface_grid(*geometry::cylinder({}, 1, 2), 6, 3, 3, 1, false, [=](double s, double t) {
    return std::array<double, 2>{
        kTurn * (s + 0.03 * (1 - std::cos(2 * kTurn * s)) + wave * std::sin(6 * kTurn * s) / (6 * kTurn)), 2 * t};
  });
  ElementBlock& first = mesh.blocks[0];
  ElementBlock second = first;
  second.entity = 2;
  const std::size_t half = first.nodes.size() / 2, count = first.numbers.size() / 2;
  second.nodes.assign(first.nodes.begin() + static_cast<std::ptrdiff_t>(half), first.nodes.end());
  second.numbers.assign(first.numbers.begin() + static_cast<std::ptrdiff_t>(count), first.numbers.end());
  first.nodes.resize(half);
  first.numbers.resize(count);
  mesh.blocks.push_back(std::move(second));
  return mesh;
}

}  // namespace varimesh::testing
