#include "core/association/smooth_joints.h"

#include <gtest/gtest.h>

#include "core/geometry/closest_point.h"
#include "tests/core/support/split_pipe.h"

namespace varimesh {
namespace {

using testing::split_pipe;
using testing::split_pipe_mesh;
constexpr double kAngle = 0.1;

Association associated(const HighOrderMesh& mesh, const geometry::Geometry& geometry = split_pipe()) {
  const Team team(1);
  Association result;
  team.run([&] {
    auto found = associate(mesh, geometry, team);
    ASSERT_TRUE(found) << found.error().sentence;
    result = std::move(*found);
  });
  return result;
}

TEST(SmoothJoints, MakeOnePipeOfTwoHalves) {
  const HighOrderMesh mesh = split_pipe_mesh(0);
  Association association = associated(mesh);
  const SmoothJoints joints = join_smoothly(mesh, association, kAngle);
  EXPECT_EQ(joints.joined_surfaces, 1);
  EXPECT_EQ(joints.free_curves, 2);
  EXPECT_EQ(joints.joined_curves, 2);
  EXPECT_EQ(joints.free_vertices, 4);
  for (const std::vector<int>& of_block : association.surface_of_element)
    EXPECT_EQ(of_block, std::vector<int>(of_block.size(), 0));
  EXPECT_EQ(association.surfaces[0].nodes.size(), mesh.node_count());
  const geometry::SurfaceShape& surface = *association.geometry.surfaces[0].shape;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const Eigen::Vector3d x(&mesh.coordinates[3 * node]);
    const NodeEntity& entity = association.nodes[node];
    const bool at_end = x[2] == 0 || x[2] == 2;
    ASSERT_EQ(entity.dimension, at_end ? 1 : 2);
    const Eigen::Vector3d there =
        at_end ? association.geometry.curves[std::size_t(entity.entity)].shape->at(entity.at[0]).x
               : surface.at(entity.at[0], entity.at[1]).x;
    EXPECT_LT((there - x).norm(), 1e-12);
    const std::array<double, 2> at = association.surfaces[0].of(std::int32_t(node));
    EXPECT_LT((surface.at(at[0], at[1]).x - x).norm(), 1e-12);
    // The normals of both halves agree, though u runs the other way on the second.
    const Eigen::Vector3d normal = surface.normal(surface.at(at[0], at[1]), at[0], at[1]);
    EXPECT_GT(normal.dot(Eigen::Vector3d(x[0], x[1], 0)), 0.999);
  }
}

TEST(SmoothJoints, LeadFeetFromOnePartToTheOther) {
  const HighOrderMesh mesh = split_pipe_mesh(0);
  Association association = associated(mesh);
  join_smoothly(mesh, association, kAngle);
  const geometry::SurfaceShape& surface = *association.geometry.surfaces[0].shape;
  const geometry::SurfaceFoot start = surface.pieces()->closest({std::cos(0.1), std::sin(0.1), 1});
  const Eigen::Vector3d beyond(std::cos(-0.1), std::sin(-0.1), 1);
  const geometry::SurfaceFoot foot = geometry::closest_from(surface, 1.01 * beyond, start.u, start.v);
  EXPECT_LT(start.u, 1);
  EXPECT_GT(foot.u, 1);
  EXPECT_TRUE(surface.contains(foot.u, foot.v));
  EXPECT_LT((foot.x - Eigen::Vector3d(beyond[0], beyond[1], 1.01)).norm(), 1e-9);
  const geometry::SurfaceFoot back = geometry::closest_from(surface, {std::cos(0.1), std::sin(0.1), 1}, foot.u, foot.v);
  EXPECT_LT(back.u, 1);
  EXPECT_LT(back.distance, 1e-12);
  // Past the end of the pipe the surface goes on to nowhere.
  const geometry::SurfaceFoot outside = geometry::closest_from(surface, {1, 0.1, 2.5}, start.u, start.v);
  EXPECT_NEAR(outside.x[2], 2, 1e-12);
}

TEST(SmoothJoints, AreNoneBetweenPhysicalGroupsAndAboveTheAngle) {
  HighOrderMesh mesh = split_pipe_mesh(0);
  mesh.blocks[0].physical = {7};
  Association association = associated(mesh);
  const SmoothJoints between_groups = join_smoothly(mesh, association, kAngle);
  EXPECT_EQ(between_groups.joined_surfaces + between_groups.joined_curves + between_groups.free_vertices, 0);

  // A box around the pipe's axis would have corners of 90°; here the second half is tilted by .2 at the joints.
  mesh.blocks[0].physical.clear();
  geometry::Geometry bent = split_pipe();
  class Tilted : public testing::PartOfSurface {
   public:
    using PartOfSurface::PartOfSurface;
    Eigen::Vector3d normal(const geometry::SurfacePoint& at, double, double) const override {
      return (at.normal() + 0.2 * at.du.normalized()).normalized();
    }
  };
  bent.surfaces[1].shape =
      std::make_shared<Tilted>(geometry::cylinder({}, 1, 2), std::numbers::pi, 2 * std::numbers::pi, true);
  association = associated(mesh, bent);
  EXPECT_EQ(join_smoothly(mesh, association, kAngle).joined_surfaces, 0);
  association = associated(mesh, bent);
  EXPECT_EQ(join_smoothly(mesh, association, 0.3).joined_surfaces, 1);
}

TEST(SmoothJoints, AreNoneAtACusp) {
  // Both surfaces are the same half of the pipe, and the second lies on the first.
  HighOrderMesh mesh = split_pipe_mesh(0);
  for (double& y : mesh.coordinates) y = y == 0 ? 0 : y;
  for (std::size_t node = 0; node < mesh.node_count(); ++node)
    mesh.coordinates[3 * node + 1] = std::abs(mesh.coordinates[3 * node + 1]);
  geometry::Geometry folded = split_pipe();
  folded.surfaces[1].shape = folded.surfaces[0].shape;
  Association association = associated(mesh, folded);
  EXPECT_EQ(join_smoothly(mesh, association, kAngle).joined_surfaces, 0);
}

}  // namespace
}  // namespace varimesh
