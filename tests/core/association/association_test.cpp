#include "core/association/association.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "core/association/file_parameters.h"
#include "core/geometry/analytic.h"
#include "tests/core/support/disc_mesh.h"
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

TEST(Associate, IsTheSameFarFromTheOrigin) {
  // A part in the coordinates of a site: ten thousand times its size from the origin.
  const Eigen::Vector3d far(2e4, -1e4, 5e3);
  geometry::Frame bottom, top;
  bottom.origin = far;
  top.origin = far + Eigen::Vector3d(0, 0, 2);
  geometry::Geometry moved = pipe(4);
  moved.curves[0].shape = geometry::circle(bottom, 1);
  moved.curves[1].shape = geometry::circle(top, 1);
  moved.surfaces[0].shape = geometry::cylinder(bottom, 1, 2);
  HighOrderMesh mesh = pipe_mesh(4);
  const Association here = associated(mesh, pipe(4));
  for (std::size_t i = 0; i < mesh.coordinates.size(); ++i) mesh.coordinates[i] += far[std::ptrdiff_t(i % 3)];
  const Association there = associated(mesh, moved);
  EXPECT_EQ(there.factor, 1);
  EXPECT_TRUE(there.held.empty());
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    EXPECT_EQ(there.nodes[node].dimension, here.nodes[node].dimension) << node;
    EXPECT_EQ(there.nodes[node].entity, here.nodes[node].entity) << node;
    EXPECT_LT(there.nodes[node].distance, 1e-10);
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

TEST(Associate, TakesOneOfTwoSurfacesThatFitEquallyWell) {
  // Each goes on where the other ends, and where both are it makes no difference.
  geometry::Geometry geometry;
  for (const double z : {-0.5, -0.1}) {
    geometry::Frame frame;
    frame.origin = {0, 0, z};
    geometry.surfaces.push_back({z < -0.3 ? 9 : 10, geometry::cylinder(frame, 1, 2.6), {}});
  }
  const Association association = associated(pipe_mesh(4), geometry);
  EXPECT_EQ(association.repeated, 0);
  EXPECT_EQ(association.matches[0].on_none, 0);
  for (const int surface : association.surface_of_element[0])
    EXPECT_EQ(surface, association.surface_of_element[0].front());
}

TEST(Associate, CountsASurfaceThatIsThereTwiceOnce) {
  geometry::Geometry geometry = pipe(9);
  geometry.surfaces.push_back({10, geometry::cylinder({}, 1, 2), {}});
  const Association association = associated(pipe_mesh(4), geometry);
  EXPECT_EQ(association.repeated, 1);
  EXPECT_EQ(association.matches[0].surface, 0);
  EXPECT_TRUE(association.held.empty());
}

TEST(Associate, TakesTheOneOfTwoSurfacesThatHasAllSamplesInside) {
  for (const bool first : {false, true}) {
    geometry::Geometry geometry = pipe(9);
    const geometry::Surface shorter{10, geometry::cylinder({}, 1, 1.4), {}};
    geometry.surfaces.insert(first ? geometry.surfaces.begin() : geometry.surfaces.end(), shorter);
    for (geometry::Curve& curve : geometry.curves) curve.surfaces = {first ? 1 : 0};
    const Association association = associated(pipe_mesh(4), geometry);
    EXPECT_EQ(association.matches[0].surface, first ? 1 : 0);
    EXPECT_TRUE(association.held.empty());
  }
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

// Three times the size is no unit, but nearly 3.28, and the bottom lies on the scaled model's.
TEST(Associate, RefusesAnotherSizeIfOnlyFewSurfacesMatch) {
  geometry::Geometry cylinder = testing::solid_cylinder();
  for (int end = 0; end < 2; ++end) {
    geometry::Frame square;
    square.origin = {-1, -1, double(end)};
    cylinder.surfaces[std::size_t(end) + 1].shape = geometry::plane(square, 2, 2);
  }
  HighOrderMesh mesh = testing::DiscMesh(2, 2).mesh();
  const Team team(1);
  EXPECT_TRUE(associate(mesh, cylinder, team));
  for (double& x : mesh.coordinates) x *= 3;
  const auto association = associate(mesh, cylinder, team);
  ASSERT_FALSE(association);
  EXPECT_NE(association.error().sentence.find("Only 1 of 3 surfaces of the mesh lies on"), std::string::npos)
      << association.error().sentence;
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

/// The pipe's mesh as a file with parameters has it: one block of nodes per node, with the parameters that projection
/// finds.
HighOrderMesh with_parameters(HighOrderMesh mesh, std::array<int, 2> curve_tags) {
  const Association association = associated(mesh, pipe(4));
  mesh.node_blocks.clear();
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const NodeEntity& entity = association.nodes[node];
    const auto index = static_cast<std::size_t>(entity.entity);
    const int tag = entity.dimension == 1 ? curve_tags[index] : mesh.blocks[0].entity;
    NodeBlock block{entity.dimension, tag, static_cast<std::int32_t>(node), 1, {entity.at[0]}};
    if (entity.dimension == 2) block.parameters.push_back(entity.at[1]);
    mesh.node_blocks.push_back(std::move(block));
  }
  return mesh;
}

TEST(Associate, TakesTheParametersOfTheFile) {
  HighOrderMesh mesh = with_parameters(pipe_mesh(4), {1, 2});
  // One turn further is the same place, so what comes back shows that the file was asked.
  for (NodeBlock& block : mesh.node_blocks) block.parameters[0] += kTurn;
  const Association association = associated(mesh, pipe(4));
  EXPECT_EQ(association.by_parameters, mesh.node_count());
  EXPECT_TRUE(association.misled.empty());
  EXPECT_TRUE(association.held.empty());
  for (std::size_t node = 0; node < mesh.node_count(); ++node)
    EXPECT_EQ(association.nodes[node].at[0], mesh.node_blocks[node].parameters[0]);
}

TEST(Associate, TakesParametersIfTheTagsOfTheMeshAreOthers) {
  for (const std::array<int, 2> curve_tags : {std::array{11, 12}, std::array{2, 1}}) {
    const HighOrderMesh mesh = with_parameters(pipe_mesh(7), curve_tags);
    const Association association = associated(mesh, pipe(4));
    EXPECT_FALSE(association.matches[0].by_tag);
    EXPECT_EQ(association.by_parameters, mesh.node_count());
    EXPECT_TRUE(association.held.empty());
  }
}

TEST(Associate, NamesNodesToWhichTheParametersDoNotLead) {
  HighOrderMesh mesh = with_parameters(pipe_mesh(4), {1, 2});
  const Association right = associated(mesh, pipe(4));
  mesh.node_blocks[3].parameters[0] += 0.01;
  mesh.node_blocks[8].parameters[0] = std::numeric_limits<double>::quiet_NaN();
  const Association association = associated(mesh, pipe(4));
  EXPECT_EQ(association.misled, (std::vector<std::int32_t>{3, 8}));
  EXPECT_EQ(association.by_parameters, mesh.node_count() - 2);
  for (const std::size_t node : {std::size_t{3}, std::size_t{8}}) {
    EXPECT_EQ(association.nodes[node].dimension, right.nodes[node].dimension);
    EXPECT_NEAR(std::remainder(association.nodes[node].at[0] - right.nodes[node].at[0], kTurn), 0, 1e-9);
  }
  const auto sentences = describe(mesh, association, 1e-6);
  ASSERT_GE(sentences.size(), 2U);
  EXPECT_NE(sentences[1].find("but not to 2 others, which were projected (node 4, 9)"), std::string::npos)
      << sentences[1];
}

TEST(KeepParameters, WritesThoseOfNodesThatMovedAndDropsThoseOfNodesThatLeft) {
  HighOrderMesh mesh = with_parameters(pipe_mesh(4), {1, 2});
  Association association = associated(mesh, pipe(4));
  association.nodes[5].at[0] = kTurn + 0.5;
  const auto& leaves = association.nodes[6];
  association.nodes[6] = {leaves.dimension == 2 ? std::int8_t{1} : std::int8_t{2}, 0, 0, {}};
  const NodeBlock stays = mesh.node_blocks[4];
  keep_parameters(mesh, association);
  EXPECT_EQ(mesh.node_blocks[4].parameters, stays.parameters);
  EXPECT_NEAR(mesh.node_blocks[5].parameters[0], 0.5, 1e-15);
  EXPECT_TRUE(mesh.node_blocks[6].parameters.empty());
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
