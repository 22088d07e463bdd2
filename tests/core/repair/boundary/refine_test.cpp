// Edges on the boundary are split with new nodes on the geometry, the mesh conforms, and everything else stays.
#include "core/repair/boundary/refine.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "tests/core/repair/boundary/conforming.h"
#include "tests/core/support/disc_mesh.h"

namespace varimesh {
namespace {

using testing::DiscMesh;
using testing::solid_cylinder;

/// The mesh with each boundary node classified on its surface and the others in the volume, as a file may have it.
HighOrderMesh classified(const HighOrderMesh& mesh) {
  HighOrderMesh result = mesh;
  std::vector<int> tag(mesh.node_count(), 0);
  for (const ElementBlock& block : mesh.blocks)
    if (block.shape == Shape::Triangle)
      for (const std::int32_t node : block.nodes) tag[static_cast<std::size_t>(node)] = block.entity;
  result.node_blocks.clear();
  for (std::size_t n = 0; n < tag.size(); ++n)
    if (const int dimension = tag[n] > 0 ? 2 : 3, entity = std::max(tag[n], 1);
        result.node_blocks.empty() || result.node_blocks.back().dimension != dimension ||
        result.node_blocks.back().entity != entity)
      result.node_blocks.push_back({dimension, entity, static_cast<std::int32_t>(n), 1});
    else
      ++result.node_blocks.back().count;
  return result;
}

struct RefinedMesh {
  HighOrderMesh mesh;
  Association association;
  RefineReport report;
  std::vector<RepairStep> steps;
};

Association associated(const HighOrderMesh& mesh, const Team& team) {
  Expected<Association> association;
  team.run([&] { association = associate(mesh, solid_cylinder(), team); });
  EXPECT_TRUE(association) << association.error().sentence;
  return std::move(*association);
}

/// Refines at these cells, by their numbers.
RefinedMesh refined(const HighOrderMesh& mesh, const std::vector<std::int64_t>& wanted, std::size_t most = 10000,
                    std::vector<bool> held = {}, int threads = 1) {
  const Team team(threads);
  RefinedMesh result{mesh, associated(mesh, team), {}, {}};
  team.run([&] {
    result.report = refine(result.mesh, result.association, {wanted, most, std::move(held)}, result.steps, team);
  });
  return result;
}

std::vector<std::int64_t> all_cells(const HighOrderMesh& mesh) {
  std::vector<std::int64_t> numbers;
  for (const ElementBlock& block : mesh.blocks)
    if (block.shape == Shape::Tetrahedron) numbers.insert(numbers.end(), block.numbers.begin(), block.numbers.end());
  std::ranges::sort(numbers);
  return numbers;
}

class Refine : public ::testing::TestWithParam<int> {
 protected:
  const HighOrderMesh mesh_ = classified(DiscMesh(2, GetParam()).mesh());
};

TEST_P(Refine, KeepsAMeshThatConforms) {
  const RefinedMesh made = refined(mesh_, all_cells(mesh_));
  EXPECT_GT(made.report.edges, 3u);
  EXPECT_EQ(made.steps.size(), made.report.edges);
  std::size_t added = 0;
  for (const RepairStep& step : made.steps) added += step.new_elements.size();
  EXPECT_EQ(made.mesh.element_count(3), mesh_.element_count(3) + added);
  testing::expect_conforming(made.mesh);
}

/// How far a node is from the surface with this tag.
double distance(const HighOrderMesh& mesh, std::int32_t node, int tag) {
  const double* x = &mesh.coordinates[3 * static_cast<std::size_t>(node)];
  return std::abs(tag == 1 ? std::hypot(x[0], x[1]) - 1 : x[2] - (tag == 3 ? 1 : 0));
}

TEST_P(Refine, PutsNewNodesOnTheSurfacesOfTheirParents) {
  const RefinedMesh made = refined(mesh_, all_cells(mesh_));
  for (const ElementBlock& block : made.mesh.blocks) {
    if (block.shape != Shape::Triangle) continue;
    for (const std::int32_t node : block.nodes) EXPECT_LT(distance(made.mesh, node, block.entity), 1e-12);
  }
  // The association is that which the mesh itself has.
  const Association own = associated(made.mesh, Team(1));
  EXPECT_EQ(own.surface_of_element, made.association.surface_of_element);
  for (std::size_t n = 0; n < own.nodes.size(); ++n) {
    EXPECT_EQ(own.nodes[n].dimension, made.association.nodes[n].dimension);
    EXPECT_EQ(own.nodes[n].entity, made.association.nodes[n].entity);
  }
  for (std::size_t s = 0; s < own.surfaces.size(); ++s)
    EXPECT_EQ(own.surfaces[s].nodes, made.association.surfaces[s].nodes);
}

TEST_P(Refine, ClassifiesNewNodesOnTheEntityOfTheirParent) {
  const RefinedMesh made = refined(mesh_, all_cells(mesh_));
  std::vector<bool> on_surface(made.mesh.node_count(), false);
  for (const ElementBlock& block : made.mesh.blocks)
    if (block.shape == Shape::Triangle)
      for (const std::int32_t node : block.nodes) on_surface[static_cast<std::size_t>(node)] = true;
  std::int32_t next = 0;
  for (const NodeBlock& block : made.mesh.node_blocks) {
    EXPECT_EQ(block.first, next);
    next += block.count;
    for (std::int32_t n = block.first; n < next; ++n) {
      EXPECT_EQ(block.dimension == 2, on_surface[static_cast<std::size_t>(n)]) << n;
      if (block.dimension == 2) {
        EXPECT_LT(distance(made.mesh, n, block.entity), 1e-12);
      }
    }
  }
  EXPECT_EQ(next, static_cast<std::int32_t>(made.mesh.node_count()));
}

TEST_P(Refine, LeavesAllOtherNodesWhereTheyAre) {
  const RefinedMesh made = refined(mesh_, {all_cells(mesh_).front()});
  ASSERT_EQ(made.steps.size(), 1u);
  std::vector<bool> touched(mesh_.node_count(), false);
  for (const ElementBlock& block : mesh_.blocks) {
    if (block.shape != Shape::Tetrahedron) continue;
    const std::size_t stride = block.nodes.size() / block.size();
    for (std::size_t e = 0; e < block.size(); ++e)
      if (std::ranges::find(made.steps[0].elements, block.numbers[e]) != made.steps[0].elements.end())
        for (std::size_t k = 0; k < stride; ++k) touched[static_cast<std::size_t>(block.nodes[e * stride + k])] = true;
  }
  EXPECT_GT(std::ranges::count(touched, false), 0);
  for (std::size_t n = 0; n < mesh_.node_count(); ++n) {
    EXPECT_EQ(made.mesh.node_numbers[n], mesh_.node_numbers[n]);
    for (std::size_t c = 0; c < 3 && !touched[n]; ++c)
      EXPECT_EQ(made.mesh.coordinates[3 * n + c], mesh_.coordinates[3 * n + c]);
  }
}

TEST_P(Refine, UnfoldsAnEdgeThatRunsBackOnItself) {
  // The nodes between the ends of each edge on a circle run from one end to the other, so they are exchanged.
  HighOrderMesh folded = mesh_;
  const Association association = associated(folded, Team(1));
  for (std::size_t n = 0; n < folded.node_count(); ++n) {
    const NodeEntity& entity = association.nodes[n];
    if (entity.dimension != 1) continue;
    double* x = &folded.coordinates[3 * n];
    const double angle = std::atan2(x[1], x[0]);
    const double moved = angle + 0.6 * std::sin(4 * (angle - 3 * 3.14159265358979 / 4));  // the vertices stay
    x[0] = std::cos(moved);
    x[1] = std::sin(moved);
  }
  const RefinedMesh made = refined(folded, all_cells(folded));
  const std::size_t had = folded.node_count();
  // Between the ends of its edge, each new vertex on a circle lies in the middle.
  int on_circle = 0;
  for (const RepairStep& step : made.steps) {
    const auto index = [&](std::int64_t number) {
      return static_cast<std::size_t>(std::ranges::find(made.mesh.node_numbers, number) -
                                      made.mesh.node_numbers.begin());
    };
    const std::size_t centre = index(step.node), a = index(step.vertices[0]), b = index(step.vertices[1]);
    EXPECT_GE(centre, had);
    if (made.association.nodes[centre].dimension != 1) continue;
    ++on_circle;
    const auto gap = [&](std::size_t from) {
      const double* x = &made.mesh.coordinates[3 * from];
      const double* y = &made.mesh.coordinates[3 * centre];
      return std::hypot(x[0] - y[0], x[1] - y[1], x[2] - y[2]);
    };
    EXPECT_NEAR(gap(a), gap(b), 1e-9);
  }
  EXPECT_GT(on_circle, 0);
}

TEST_P(Refine, AddsNoMoreCellsThanItMay) {
  const std::size_t came = mesh_.element_count(3);
  const RefinedMesh none = refined(mesh_, all_cells(mesh_), came);
  EXPECT_EQ(none.report.edges, 0u);
  EXPECT_TRUE(none.report.is_full);
  EXPECT_EQ(none.mesh.coordinates, mesh_.coordinates);
  const RefinedMesh some = refined(mesh_, all_cells(mesh_), came + 7);
  EXPECT_GT(some.report.edges, 0u);
  EXPECT_LE(some.mesh.element_count(3), came + 7);
}

TEST_P(Refine, LeavesHeldAndPeriodicEdges) {
  const RefinedMesh held = refined(mesh_, all_cells(mesh_), 10000, std::vector<bool>(mesh_.node_count(), true));
  for (const RepairStep& step : held.steps)
    EXPECT_NE(step.sentence.find("The interior edge"), std::string::npos) << step.sentence;
  HighOrderMesh periodic = mesh_;
  PeriodicLink link{2, 3, 2, {}, {}};
  for (std::int32_t n = 0; n < static_cast<std::int32_t>(mesh_.node_count()); ++n) link.nodes.emplace_back(n, n);
  periodic.periodic.push_back(link);
  EXPECT_EQ(refined(periodic, all_cells(periodic)).report.edges, 0u);
}

TEST_P(Refine, DoesNotDependOnTheNumberOfThreads) {
  const RefinedMesh one = refined(mesh_, all_cells(mesh_)), three = refined(mesh_, all_cells(mesh_), 10000, {}, 3);
  EXPECT_EQ(one.mesh.coordinates, three.mesh.coordinates);
  EXPECT_EQ(one.mesh.node_numbers, three.mesh.node_numbers);
}

TEST_P(Refine, NamesTheSurfaces) {
  const RefinedMesh made = refined(mesh_, all_cells(mesh_));
  EXPECT_TRUE(made.report.surfaces.contains("1"));
  EXPECT_NE(made.steps[0].sentence.find("The boundary edge between nodes"), std::string::npos)
      << made.steps[0].sentence;
}

INSTANTIATE_TEST_SUITE_P(Orders, Refine, ::testing::Values(2, 3, 4),
                         [](const auto& info) { return "Order" + std::to_string(info.param); });

}  // namespace
}  // namespace varimesh
