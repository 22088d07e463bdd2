#include "core/association/association.h"

#include <gtest/gtest.h>

#include <numbers>

#include "core/geometry/analytic.h"
#include "tests/core/support/surface_grid.h"

namespace varimesh {
namespace {

using testing::surface_grid;
constexpr double kTurn = 2 * std::numbers::pi;

/// A pipe: a cylinder of radius 1 and height 2 between two circles.
geometry::Geometry pipe(int tag) {
  geometry::Geometry pipe;
  geometry::Frame top;
  top.origin = {0, 0, 2};
  pipe.curves.push_back({1, geometry::circle({}, 1), {}, {0}});
  pipe.curves.push_back({2, geometry::circle(top, 1), {}, {0}});
  pipe.surfaces.push_back({tag, geometry::cylinder({}, 1, 2), {0, 1}});
  return pipe;
}

HighOrderMesh pipe_mesh(int tag) {
  return surface_grid(*pipe(tag).surfaces[0].shape, 6, 3, 3, tag, false, [](double s, double t) {
    return std::array<double, 2>{kTurn * s, 2 * t};
  });
}

Association associated(const HighOrderMesh& mesh, const geometry::Geometry& geometry) {
  const Team team(1);
  const auto result = associate(mesh, geometry, team);
  EXPECT_TRUE(result) << result.error().sentence;
  return *result;
}

TEST(Associate, PutsBorderNodesOnCurvesAndTheOthersOnSurfaces) {
  const HighOrderMesh mesh = pipe_mesh(4);
  const Association association = associated(mesh, pipe(4));
  ASSERT_EQ(association.matches.size(), 1U);
  EXPECT_TRUE(association.matches[0].by_tag);
  EXPECT_TRUE(association.held.empty());
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const NodeEntity& entity = association.nodes[node];
    const double z = mesh.coordinates[3 * node + 2];
    EXPECT_EQ(entity.dimension, z == 0 || z == 2 ? 1 : 2) << node;
    EXPECT_EQ(entity.entity, z == 2 ? 1 : 0) << node;
    EXPECT_LT(entity.distance, 1e-14);
  }
}

TEST(Associate, FindsASurfaceWithAnotherTagByDistance) {
  geometry::Geometry geometry = pipe(9);
  geometry::Frame aside;
  aside.origin = {5, 0, 0};
  geometry.surfaces.insert(geometry.surfaces.begin(), {4, geometry::cylinder(aside, 1, 2), {}});
  for (geometry::Curve& curve : geometry.curves) curve.surfaces = {1};
  const Association association = associated(pipe_mesh(4), geometry);
  EXPECT_EQ(association.matches[0].surface, 1);
  EXPECT_FALSE(association.matches[0].by_tag);
}

TEST(Associate, TakesNeitherOfTwoSurfacesThatFitEquallyWell) {
  geometry::Geometry geometry = pipe(9);
  geometry.surfaces.push_back({10, geometry::cylinder({}, 1, 2), {}});
  const Team team(1);
  const auto association = associate(pipe_mesh(4), geometry, team);
  ASSERT_FALSE(association);
  EXPECT_NE(association.error().sentence.find("No surface of the mesh"), std::string::npos);
}

TEST(Associate, ScalesAGeometryInAnotherUnit) {
  const HighOrderMesh mesh = pipe_mesh(4);
  for (const double factor : {1000.0, 0.001, 1 / 25.4}) {
    const Association association = associated(mesh, scaled(pipe(4), factor));
    EXPECT_NEAR(association.factor, 1 / factor, 1e-12 / factor);
    EXPECT_TRUE(association.held.empty());
    const auto sentences = describe(mesh, association, 1e-6);
    ASSERT_GE(sentences.size(), 2U);
    EXPECT_NE(sentences[1].find("times those in the geometry"), std::string::npos);
  }
}

TEST(Associate, RefusesAnotherBody) {
  geometry::Geometry other;
  other.surfaces.push_back({4, geometry::sphere({}, 7), {}});
  const Team team(1);
  const auto association = associate(pipe_mesh(4), other, team);
  ASSERT_FALSE(association);
  EXPECT_EQ(association.error().kind, Error::Kind::BadInput);
}

TEST(Associate, RefusesAMeshWithoutSurfaces) {
  HighOrderMesh mesh = pipe_mesh(4);
  mesh.blocks.clear();
  const Team team(1);
  const auto association = associate(mesh, pipe(4), team);
  ASSERT_FALSE(association);
  EXPECT_NE(association.error().sentence.find("no elements on its surfaces"), std::string::npos);
}

TEST(Snap, PutsNodesThatAreOffOnTheSurface) {
  HighOrderMesh mesh = pipe_mesh(4);
  const std::vector<double> exact = mesh.coordinates;
  std::size_t node = 0;
  while (mesh.coordinates[3 * node + 2] == 0) ++node;
  mesh.coordinates[3 * node] *= 1 + 1e-4;
  mesh.coordinates[3 * node + 1] *= 1 + 1e-4;
  Association association = associated(mesh, pipe(4));
  const auto sentences = describe(mesh, association, 1e-6);
  ASSERT_GE(sentences.size(), 2U);
  EXPECT_NE(sentences[1].find("Node " + std::to_string(node + 1) + " is 0.0001 from surface 4"), std::string::npos)
      << sentences[1];
  EXPECT_EQ(snap(mesh, association, 1e-6), 1U);
  for (std::size_t i = 0; i < exact.size(); ++i) EXPECT_NEAR(mesh.coordinates[i], exact[i], 1e-12);
  EXPECT_EQ(snap(mesh, association, 1e-6), 0U);
}

}  // namespace
}  // namespace varimesh
