#include "core/association/plane/profile.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/association/plane/flattened.h"
#include "core/geometry/analytic.h"
#include "core/geometry/closest_point.h"
#include "core/mesh/plane.h"
#include "tests/core/support/ring_mesh.h"

namespace varimesh {
namespace {

using testing::ring_mesh;

constexpr int kColumns = 12;

/// Circles in a plane, and a line that leaves it.
geometry::Geometry circles(const std::vector<double>& radii, const geometry::Frame& frame = {}) {
  geometry::Geometry result;
  for (const double radius : radii)
    result.curves.push_back({int(result.curves.size()) + 1, geometry::circle(frame, radius), {}, {}});
  result.curves.push_back({99, geometry::line(frame.origin, frame.origin + frame.axes.col(2)), {}, {}});
  return result;
}

Association associated(const HighOrderMesh& mesh, const geometry::Geometry& geometry) {
  const Team team(1);
  Expected<Association> result;
  team.run([&] { result = associate_in_plane(mesh, geometry, team); });
  EXPECT_TRUE(result) << result.error().sentence;
  return result ? std::move(*result) : Association();
}

std::vector<int> dimensions(const Association& association) {
  std::vector<int> result;
  for (std::size_t row = 0; row * kColumns < association.nodes.size(); ++row) {
    result.push_back(association.nodes[row * kColumns].dimension);
    for (int i = 0; i < kColumns; ++i)
      EXPECT_EQ(association.nodes[row * kColumns + std::size_t(i)].dimension, result.back()) << row << ' ' << i;
  }
  return result;
}

TEST(Profile, HasTheCurvesInThePlaneAndTheBorderOnThem) {
  const HighOrderMesh mesh = ring_mesh({1, 2, 3}, kColumns);
  const Association association = associated(mesh, circles({1, 3}));
  EXPECT_TRUE(association.in_plane);
  EXPECT_EQ(association.geometry.curves.size(), 2u);
  EXPECT_EQ(dimensions(association), (std::vector<int>{1, 2, 1}));
  EXPECT_TRUE(association.held.empty());
  EXPECT_EQ(association.surface_of_element, (std::vector<std::vector<int>>(2, std::vector<int>(kColumns, 0))));
}

TEST(Profile, HoldsTheBorderWhereThereIsNoCurve) {
  const Association association = associated(ring_mesh({1, 2, 3}, kColumns), circles({1}));
  EXPECT_EQ(dimensions(association), (std::vector<int>{1, 2, -1}));
  EXPECT_EQ(association.held.size(), std::size_t(kColumns));
  EXPECT_LT(association.size, 3);  // that of the curve, not of the far field
}

TEST(Profile, PutsNodesBetweenRegionsOnACurveOnlyIfTheyLieOnIt) {
  const HighOrderMesh mesh = ring_mesh({1, 2, 3}, kColumns);
  const Association on = associated(mesh, circles({1, 2, 3})), near = associated(mesh, circles({1, 2.001, 3}));
  EXPECT_EQ(dimensions(on), (std::vector<int>{1, 1, 1}));
  EXPECT_EQ(on.geometry.curves[1].surfaces, (std::vector<int>{0, 0}));
  EXPECT_EQ(on.geometry.curves[0].surfaces, (std::vector<int>{0}));
  EXPECT_EQ(dimensions(near), (std::vector<int>{1, 2, 1}));
  // The border of a mesh may be a little off its curve.
  EXPECT_EQ(dimensions(associated(mesh, circles({1.001, 3}))), (std::vector<int>{1, 2, 1}));
}

TEST(Profile, TakesAnyPlane) {
  geometry::Frame frame;
  frame.origin = {5, -3, 2};
  frame.axes = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  HighOrderMesh mesh = ring_mesh({1, 2, 3}, kColumns);
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    Eigen::Map<Eigen::Vector3d> x(&mesh.coordinates[3 * node]);
    x = frame.origin + frame.axes * Eigen::Vector3d(x);
  }
  EXPECT_TRUE(lies_in_a_plane(mesh));
  EXPECT_EQ(dimensions(associated(mesh, circles({1, 3}, frame))), (std::vector<int>{1, 2, 1}));
  // Where the mesh is in its plane, the curves are too.
  const Team team(1);
  Expected<Association> flat;
  team.run([&] {
    auto plane = Plane::of(mesh, team);
    ASSERT_TRUE(plane);
    plane->flatten(mesh);
    flat = associate_flattened(mesh, *plane, circles({1, 3}, frame), team);
  });
  ASSERT_TRUE(flat) << flat.error().sentence;
  EXPECT_EQ(dimensions(*flat), (std::vector<int>{1, 2, 1}));
  for (const geometry::Curve& curve : flat->geometry.curves) {
    const geometry::CurveFoot foot =
        geometry::CurveSearch(*curve.shape).closest(Eigen::Map<Eigen::Vector3d>(mesh.coordinates.data()));
    EXPECT_NEAR(foot.x[2], 0, 1e-12);
    EXPECT_NEAR(curve.shape->at(0.3).dt[2], 0, 1e-12);
  }
  EXPECT_LT(flat->nodes[0].distance, 1e-12);
}

/// Gmsh writes the centres of arcs as nodes that no cell has.
TEST(Profile, TakesNoNoticeOfNodesThatNoCellHas) {
  geometry::Frame frame;
  frame.origin = {0, 0, 3};
  HighOrderMesh mesh = ring_mesh({1, 2, 3}, kColumns);
  for (std::size_t node = 0; node < mesh.node_count(); ++node) mesh.coordinates[3 * node + 2] = 3;
  mesh.coordinates.insert(mesh.coordinates.end(), {0, -20, 0});
  mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_count()));
  const Association association = associated(mesh, circles({1, 3}, frame));
  EXPECT_EQ(association.geometry.curves.size(), 2u);
  EXPECT_EQ(association.nodes[0].dimension, 1);
}

TEST(Profile, ScalesAGeometryInAnotherUnit) {
  const Association association = associated(ring_mesh({1, 2, 3}, kColumns), circles({1000, 3000}));
  EXPECT_DOUBLE_EQ(association.factor, 1e-3);
  EXPECT_EQ(dimensions(association), (std::vector<int>{1, 2, 1}));
}

TEST(Profile, RefusesAnotherPlaneAndAnotherProfile) {
  const HighOrderMesh mesh = ring_mesh({1, 3}, kColumns);
  const Team team(1);
  geometry::Frame above;
  above.origin = {0, 0, 0.1};
  team.run([&] {
    EXPECT_NE(associate_in_plane(mesh, circles({1}, above), team).error().sentence.find("No curve"), std::string::npos);
    EXPECT_NE(associate_in_plane(mesh, circles({2}), team).error().sentence.find("No edge"), std::string::npos);
  });
}

TEST(Profile, RefusesAMeshThatTouchesTheCurvesByChance) {
  // One edge of twelve lies on a line, and one more node on another.
  const HighOrderMesh mesh = ring_mesh({1, 2}, kColumns);
  const auto x = [&](int node) {
    return Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * static_cast<std::size_t>(node)]);
  };
  geometry::Geometry lines;
  const Eigen::Vector3d a = x(kColumns), b = x(kColumns + 1);
  lines.curves.push_back({1, geometry::line(a - 5 * (b - a), a + 5 * (b - a)), {}, {}});
  lines.curves.push_back({2, geometry::line(x(kColumns + 6), 2 * x(kColumns + 6)), {}, {}});
  const Team team(1);
  Expected<Association> result;
  team.run([&] { result = associate_in_plane(mesh, lines, team); });
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().sentence.find("Only 1 of 24 edges"), std::string::npos) << result.error().sentence;
  // If the edge covers half of a short line, the two belong together.
  lines.curves[0] = {1, geometry::line(a, a + 1.5 * (b - a)), {}, {}};
  team.run([&] { result = associate_in_plane(mesh, lines, team); });
  EXPECT_TRUE(result);
}

}  // namespace
}  // namespace varimesh
