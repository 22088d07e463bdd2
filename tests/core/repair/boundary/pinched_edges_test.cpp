// Two sides of a hole that a coarse mesh joins in one edge get a vertex each.
#include "core/repair/boundary/pinched_edges.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/curve/curve.h"
#include "core/mesh/check.h"
#include "core/mesh/conformity.h"
#include "core/repair/boundary/refine.h"
#include "tests/core/support/split_pipe.h"

namespace varimesh {
namespace {

using testing::split_pipe;
constexpr std::int32_t kFirstEnd = 0, kLastEnd = 1;

/// Adds a tetrahedron with a positive volume.
void add_cell(HighOrderMesh& mesh, std::array<std::int32_t, 4> v) {
  const auto x = [&](std::size_t k) {
    return Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * static_cast<std::size_t>(v[k])]));
  };
  if ((x(1) - x(0)).cross(x(2) - x(0)).dot(x(3) - x(0)) < 0) std::swap(v[2], v[3]);
  ElementBlock& block = mesh.blocks[2];
  block.nodes.insert(block.nodes.end(), v.begin(), v.end());
  block.numbers.push_back(static_cast<std::int64_t>(block.numbers.size()) + 5);
}

/// Around a hole of radius 1 (split_pipe.h), whose halves have an edge across the hole in common. On each half there
/// are two triangles.
/// @param outside  whether the cells lie around the hole; else in it, as if it were a pin
HighOrderMesh across_a_hole(bool outside) {
  HighOrderMesh mesh;
  mesh.dimension = 3;
  mesh.order = 1;
  mesh.coordinates = {1, 0, 1, -1, 0, 1};
  for (const double side : {1.0, -1.0})
    mesh.coordinates.insert(mesh.coordinates.end(), {0, side, 0.4, 0, side, 1.6, 0, 3 * side, 1});
  for (std::int64_t node = 1; node <= 8; ++node) mesh.node_numbers.push_back(node);
  mesh.blocks.resize(3);
  for (int side = 0; side < 2; ++side) {
    ElementBlock& block = mesh.blocks[static_cast<std::size_t>(side)];
    block.shape = Shape::Triangle;
    block.entity = side + 1;
    for (int k = 0; k < 2; ++k) {
      block.nodes.insert(block.nodes.end(), {kFirstEnd, kLastEnd, 2 + 3 * side + k});
      block.numbers.push_back(1 + 2 * side + k);
    }
  }
  mesh.blocks[2].shape = Shape::Tetrahedron;
  mesh.blocks[2].entity = 1;
  for (std::int32_t k = 0; k < 2; ++k) {
    if (outside) {
      for (std::int32_t side = 0; side < 2; ++side)
        add_cell(mesh, {kFirstEnd, kLastEnd, 2 + 3 * side + k, 4 + 3 * side});
    } else {
      add_cell(mesh, {kFirstEnd, kLastEnd, 2 + k, 5 + k});
    }
  }
  NodeBlock nodes;
  nodes.count = 8;
  mesh.node_blocks.push_back(nodes);
  return mesh;
}

/// The mesh with each node of a surface element classified on the first surface that has it.
void classify(HighOrderMesh& mesh) {
  std::vector<int> tag(mesh.node_count(), 0);
  for (const std::size_t b : {1u, 0u})
    for (const std::int32_t node : mesh.blocks[b].nodes) tag[static_cast<std::size_t>(node)] = mesh.blocks[b].entity;
  mesh.node_blocks.clear();
  for (std::size_t n = 0; n < tag.size(); ++n)
    mesh.node_blocks.push_back({tag[n] > 0 ? 2 : 3, std::max(tag[n], 1), static_cast<std::int32_t>(n), 1, {}});
}

CurvedMesh curved(const HighOrderMesh& mesh, int order, const Team& team) {
  Expected<CurvedMesh> result;
  team.run([&] {
    auto association = associate(mesh, split_pipe(), team);
    ASSERT_TRUE(association) << association.error().sentence;
    result = curve(mesh, std::move(*association), order, team);
  });
  EXPECT_TRUE(result) << result.error().sentence;
  return std::move(*result);
}

class PinchedEdges : public ::testing::TestWithParam<std::tuple<int, bool>> {};

TEST_P(PinchedEdges, GetAVertexOnEachSide) {
  const auto [order, is_classified] = GetParam();
  const Team team(1);
  CurvedMesh start = curved(across_a_hole(true), order, team);
  if (is_classified) classify(start.mesh);
  HighOrderMesh mesh = start.mesh;
  std::vector<RepairStep> steps;
  RefineReport report;
  const std::vector<std::int64_t> wanted{5};
  team.run([&] { report = refine(mesh, start.association, {wanted, 100, {}}, steps, team); });
  EXPECT_EQ(report.edges, 1u);
  EXPECT_EQ(steps.size(), 2u);
  EXPECT_EQ(mesh.element_count(3), 8u);
  EXPECT_EQ(mesh.element_count(2), 8u);

  const auto checked = check_structure(mesh);
  EXPECT_TRUE(checked) << checked.error().sentence;
  EXPECT_TRUE(check_conformity(mesh, facets(mesh), Team(1)));
  std::vector<bool> used(mesh.node_count(), false);
  for (const ElementBlock& block : mesh.blocks)
    for (const std::int32_t node : block.nodes) used[static_cast<std::size_t>(node)] = true;
  EXPECT_EQ(std::ranges::count(used, false), 0);
  std::int32_t next = 0;
  for (const NodeBlock& block : mesh.node_blocks) {
    EXPECT_EQ(block.first, next);
    next += block.count;
  }
  EXPECT_EQ(next, static_cast<std::int32_t>(mesh.node_count()));

  // Each new vertex lies on its half of the hole, farthest from the edge that there was, and so do the nodes of its
  // edges.
  for (std::size_t b = 0; b < 2; ++b) {
    const double side = b == 0 ? 1 : -1;
    const ElementBlock& block = mesh.blocks[b];
    const std::size_t stride = block.nodes.size() / block.size();
    std::size_t checked_edges = 0;
    for (std::size_t e = 0; e < block.size(); ++e)
      for (std::size_t v = 0; v < 3; ++v) {
        const std::int32_t* nodes = &block.nodes[e * stride];
        if (nodes[v] < static_cast<std::int32_t>(start.mesh.node_count())) continue;
        EXPECT_NEAR(side * mesh.coordinates[3 * static_cast<std::size_t>(nodes[v]) + 1], 1, 1e-9);
        for (const std::size_t edge : {v, (v + 2) % 3})
          for (int k = 0; k < order - 1; ++k, ++checked_edges) {
            const std::size_t local = 3 + edge * static_cast<std::size_t>(order - 1) + static_cast<std::size_t>(k);
            const double* x = &mesh.coordinates[3 * static_cast<std::size_t>(nodes[local])];
            EXPECT_NEAR(std::hypot(x[0], x[1]), 1, 1e-12);
            EXPECT_GT(side * x[1], 0);
          }
      }
    EXPECT_EQ(checked_edges, 8u * static_cast<std::size_t>(order - 1));
  }
}

INSTANTIATE_TEST_SUITE_P(Orders, PinchedEdges, ::testing::Combine(::testing::Values(2, 3, 4), ::testing::Bool()));

TEST(PinchedEdges, AreNotThoseOfAPin) {
  const Team team(1);
  const CurvedMesh start = curved(across_a_hole(false), 3, team);
  const Cells cells(start.mesh, 3);
  const std::vector<bool> none(start.mesh.node_count(), false);
  const detail::MeshParts parts(start.mesh, start.association.surface_of_element);
  EXPECT_TRUE(pinched_edges(start.mesh, start.association, parts, cells, SplitRules(start.mesh, cells, none)).empty());
}

TEST(PinchedEdges, AreNoneIfALineLiesOnThem) {
  HighOrderMesh linear = across_a_hole(true);
  const Team team(1);
  CurvedMesh start = curved(linear, 2, team);
  const Cells cells(start.mesh, 3);
  const std::vector<bool> none(start.mesh.node_count(), false);
  const detail::MeshParts parts(start.mesh, start.association.surface_of_element);
  const auto found = [&] {
    return pinched_edges(start.mesh, start.association, parts, cells, SplitRules(start.mesh, cells, none)).size();
  };
  EXPECT_EQ(found(), 1u);
  ElementBlock line;
  line.shape = Shape::Line;
  line.order = 2;
  line.entity = 9;
  line.numbers = {99};
  line.nodes = {kFirstEnd, kLastEnd, start.mesh.blocks[0].nodes[3]};
  start.mesh.blocks.push_back(line);
  start.association.surface_of_element.emplace_back();
  EXPECT_EQ(found(), 0u);
}

}  // namespace
}  // namespace varimesh
