#include "core/association/own_boundary.h"

#include <gtest/gtest.h>

#include <numbers>

#include "core/geometry/analytic.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/surface_grid.h"

namespace varimesh {
namespace {

using testing::read_case;
using testing::surface_grid;
constexpr double kTurn = 2 * std::numbers::pi;

OwnBoundary boundary_of(const HighOrderMesh& mesh, int threads = 1) {
  const Team team(threads);
  Expected<OwnBoundary> made;
  team.run([&] { made = own_boundary(mesh, team); });
  EXPECT_TRUE(made) << made.error().sentence;
  return std::move(*made);
}

std::array<std::size_t, 3> counts(const OwnBoundary& boundary) {
  const geometry::Geometry& of = boundary.association.geometry;
  return {of.surfaces.size(), of.curves.size(), of.vertices.size()};
}

Eigen::Vector3d position(const HighOrderMesh& mesh, std::size_t node) {
  return Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * node]);
}

/// Each boundary node lies where its parameters say, on its own entity and on all surfaces that have it.
void check_places(const HighOrderMesh& mesh, const OwnBoundary& boundary) {
  const Association& of = boundary.association;
  std::vector<bool> on_boundary(mesh.node_count(), false);
  for (std::size_t s = 0; s < of.surfaces.size(); ++s)
    for (std::size_t i = 0; i < of.surfaces[s].nodes.size(); ++i) {
      const auto node = static_cast<std::size_t>(of.surfaces[s].nodes[i]);
      on_boundary[node] = true;
      const auto [u, v] = of.surfaces[s].parameters[i];
      EXPECT_LT((of.geometry.surfaces[s].shape->at(u, v).x - position(mesh, node)).norm(), 1e-13);
    }
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const NodeEntity& entity = of.nodes[node];
    EXPECT_EQ(entity.dimension >= 0, on_boundary[node]);
    const auto e = static_cast<std::size_t>(entity.entity);
    const Eigen::Vector3d x = position(mesh, node);
    if (entity.dimension < 0) continue;
    const Eigen::Vector3d there = entity.dimension == 0 ? of.geometry.vertices[e].x
                                  : entity.dimension == 1
                                      ? of.geometry.curves[e].shape->at(entity.at[0]).x
                                      : of.geometry.surfaces[e].shape->at(entity.at[0], entity.at[1]).x;
    EXPECT_LT((there - x).norm(), 1e-13);
  }
}

TEST(OwnBoundary, OfACubeWithoutABallHasItsFacesEdgesAndCorners) {
  const HighOrderMesh mesh = read_case("sphere_p3.msh");
  const OwnBoundary boundary = boundary_of(mesh);
  EXPECT_EQ(counts(boundary), (std::array<std::size_t, 3>{7, 12, 8}));
  check_places(mesh, boundary);
  for (const geometry::Curve& curve : boundary.association.geometry.curves) {
    EXPECT_EQ(curve.vertices.size(), 2U);
    EXPECT_EQ(curve.surfaces.size(), 2U);
  }
  // Only the ball is curved.
  int curved = 0;
  for (const geometry::InterpolationError& allowed : boundary.association.allowed_on_surfaces)
    curved += allowed.largest > 1e-9 ? 1 : 0;
  EXPECT_EQ(curved, 1);
}

TEST(OwnBoundary, FindsSurfacesWithoutElementsOfThem) {
  HighOrderMesh mesh = read_case("sphere_p3.msh");
  std::erase_if(mesh.blocks, [](const ElementBlock& block) { return reference::info(block.shape).dimension < 3; });
  EXPECT_EQ(counts(boundary_of(mesh)), (std::array<std::size_t, 3>{7, 12, 8}));
}

TEST(OwnBoundary, OfABallIsOneSurface) {
  const HighOrderMesh mesh = read_case("solid_ball_p3.msh");
  const OwnBoundary boundary = boundary_of(mesh);
  EXPECT_EQ(counts(boundary), (std::array<std::size_t, 3>{1, 0, 0}));
  check_places(mesh, boundary);
  EXPECT_EQ(boundary.faces.node_count(), mesh.node_count());
}

TEST(OwnBoundary, OfAPipeEndsInClosedCurves) {
  const auto cylinder = geometry::cylinder({}, 1, 2);
  const HighOrderMesh mesh = surface_grid(*cylinder, 8, 3, 3, 7, false, [](double s, double t) {
    return std::array<double, 2>{kTurn * s, 2 * t};
  });
  const OwnBoundary boundary = boundary_of(mesh);
  EXPECT_EQ(counts(boundary), (std::array<std::size_t, 3>{1, 2, 0}));
  check_places(mesh, boundary);
  for (const geometry::Curve& curve : boundary.association.geometry.curves) EXPECT_GT(curve.shape->range().period, 0);
}

TEST(OwnBoundary, KeepsEntitiesOfTheFileApart) {
  const auto cylinder = geometry::cylinder({}, 1, 2);
  HighOrderMesh mesh = surface_grid(*cylinder, 8, 3, 3, 7, false, [](double s, double t) {
    return std::array<double, 2>{kTurn * s, 2 * t};
  });
  // The elements of the first three columns belong to another entity: two straight curves between four corners.
  ElementBlock& all = mesh.blocks[0];
  ElementBlock other = all;
  other.entity = 8;
  other.numbers.resize(9);
  other.nodes.resize(9 * 16);
  all.numbers.erase(all.numbers.begin(), all.numbers.begin() + 9);
  all.nodes.erase(all.nodes.begin(), all.nodes.begin() + 9 * 16);
  mesh.blocks.push_back(other);
  EXPECT_EQ(counts(boundary_of(mesh)), (std::array<std::size_t, 3>{2, 6, 4}));
}

TEST(OwnBoundary, HoldsTheTipOfACone) {
  const auto cone = geometry::cone({}, 0, 0.4, 1);
  HighOrderMesh mesh = surface_grid(*cone, 12, 2, 2, 1, false, [](double s, double t) {
    return std::array<double, 2>{kTurn * s, t};
  });
  // The lowest row of nodes is one point: its triangles are made of quadrilaterals.
  ElementBlock tip;
  tip.shape = Shape::Triangle;
  tip.order = 2;
  tip.entity = 1;
  ElementBlock& quads = mesh.blocks[0];
  const std::int32_t apex = quads.nodes[0];
  std::vector<std::int64_t> numbers;
  std::vector<std::int32_t> nodes;
  for (std::size_t e = 0; e < quads.size(); ++e) {
    const std::int32_t* q = &quads.nodes[9 * e];
    const bool at_tip = mesh.coordinates[3 * static_cast<std::size_t>(q[0]) + 2] == 0;
    if (at_tip) {
      // Vertices 0 and 1 of the quadrilateral are the tip; its node in the middle is that of no edge of the triangle.
      tip.numbers.push_back(quads.numbers[e]);
      for (const std::int32_t node : {apex, q[2], q[3], q[5], q[6], q[7]}) tip.nodes.push_back(node);
    } else {
      numbers.push_back(quads.numbers[e]);
      nodes.insert(nodes.end(), q, q + 9);
    }
  }
  quads.numbers = numbers;
  quads.nodes = nodes;
  mesh.blocks.push_back(tip);
  const OwnBoundary boundary = boundary_of(mesh);
  EXPECT_EQ(counts(boundary), (std::array<std::size_t, 3>{1, 1, 1}));
  EXPECT_EQ(boundary.association.nodes[static_cast<std::size_t>(apex)].dimension, 0);
}

TEST(OwnBoundary, HoldsNodesBetweenVolumes) {
  HighOrderMesh mesh = read_case("solid_ball_p3.msh");
  ElementBlock& all = *std::ranges::find(mesh.blocks, Shape::Tetrahedron, &ElementBlock::shape);
  ElementBlock half = all;
  half.entity = all.entity + 1;
  const std::size_t count = all.size() / 2, stride = all.nodes.size() / all.size();
  half.numbers.assign(all.numbers.begin(), all.numbers.begin() + static_cast<std::ptrdiff_t>(count));
  half.nodes.assign(all.nodes.begin(), all.nodes.begin() + static_cast<std::ptrdiff_t>(count * stride));
  all.numbers.erase(all.numbers.begin(), all.numbers.begin() + static_cast<std::ptrdiff_t>(count));
  all.nodes.erase(all.nodes.begin(), all.nodes.begin() + static_cast<std::ptrdiff_t>(count * stride));
  mesh.blocks.push_back(half);
  const OwnBoundary boundary = boundary_of(mesh);
  EXPECT_FALSE(boundary.association.held.empty());
  for (const std::int32_t node : boundary.association.held)
    EXPECT_EQ(boundary.association.nodes[static_cast<std::size_t>(node)].dimension, -1);
}

TEST(OwnBoundary, IsTheSameForAnyNumberOfThreads) {
  const HighOrderMesh mesh = read_case("sphere_p3.msh");
  const OwnBoundary one = boundary_of(mesh, 1), three = boundary_of(mesh, 3);
  EXPECT_EQ(one.association.held, three.association.held);
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    EXPECT_EQ(one.association.nodes[node].entity, three.association.nodes[node].entity);
    EXPECT_EQ(one.association.nodes[node].at, three.association.nodes[node].at);
  }
  for (std::size_t s = 0; s < one.association.surfaces.size(); ++s)
    EXPECT_EQ(one.association.allowed_on_surfaces[s].largest, three.association.allowed_on_surfaces[s].largest);
}

TEST(OwnBoundary, IsFlatAtOrderOne) {
  // Around a prism of twelve sides, elements turn by 30 degrees, but they are flat: each side is a surface of its own.
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  constexpr int kSides = 12, kRows = 2;
  ElementBlock block;
  block.shape = Shape::Quadrilateral;
  block.entity = 1;
  for (int row = 0; row <= kRows; ++row)
    for (int i = 0; i < kSides; ++i) {
      const double angle = 2 * std::numbers::pi * i / kSides;
      for (const double c : {std::cos(angle), std::sin(angle), double(row)}) mesh.coordinates.push_back(c);
      mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_numbers.size()) + 1);
    }
  for (int row = 0; row < kRows; ++row)
    for (int i = 0; i < kSides; ++i) {
      const int next = (i + 1) % kSides, below = row * kSides, above = below + kSides;
      block.numbers.push_back(below + i + 1);
      for (const int node : {below + i, below + next, above + next, above + i}) block.nodes.push_back(node);
    }
  mesh.blocks.push_back(block);
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())}};
  const OwnBoundary made = boundary_of(mesh, 1);
  EXPECT_EQ(made.association.geometry.surfaces.size(), std::size_t{kSides});
  for (int i = 0; i < kSides; ++i) {
    EXPECT_EQ(made.association.nodes[std::size_t(i)].dimension, 0) << "a corner";
    EXPECT_EQ(made.association.nodes[std::size_t(kSides + i)].dimension, 1) << "in the middle of an edge";
  }
}

}  // namespace
}  // namespace varimesh
