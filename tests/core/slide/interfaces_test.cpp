// Nodes slide on interfaces between regions, as on the boundary, without a model.
#include <gtest/gtest.h>

#include <cmath>

#include "core/association/own_boundary.h"
#include "core/reference/nodes.h"
#include "core/slide/on_file/slide_on_file.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

/// A cube of 4 × 4 × 4 hexahedra or of tetrahedra. The cells with x > 1/2 are the region 2.
/// @param has_elements  there are elements between the regions, of the surface 7
HighOrderMesh two_regions(Filling filling, int order, bool has_elements = true) {
  HighOrderMesh mesh = testing::grid(filling, {4, 4, 4}, order);
  ElementBlock& left = *std::ranges::find_if(
      mesh.blocks, [](const ElementBlock& block) { return reference::info(block.shape).dimension == 3; });
  const auto stride = left.nodes.size() / left.size();
  ElementBlock all = left, right = left, between;
  right.entity = left.entity + 1;
  for (ElementBlock* block : {&left, &right}) {
    block->numbers.clear();
    block->nodes.clear();
  }
  const reference::ShapeInfo& info = reference::info(all.shape);
  between.shape = info.facets[0].shape;
  between.order = order;
  between.entity = 7;
  const auto x = [&](std::int32_t node) { return mesh.coordinates[3 * std::size_t(node)]; };
  for (std::size_t e = 0; e < all.size(); ++e) {
    const std::int32_t* nodes = &all.nodes[e * stride];
    double sum = 0;
    for (int v = 0; v < info.vertices; ++v) sum += x(nodes[v]);
    ElementBlock& block = sum / info.vertices > 0.5 ? right : left;
    block.numbers.push_back(all.numbers[e]);
    block.nodes.insert(block.nodes.end(), nodes, nodes + stride);
    for (int f = 0; &block == &left && f < int(info.facets.size()); ++f) {
      std::vector<std::int32_t> facet;
      for (const int local : reference::facet_nodes(all.shape, order, f)) facet.push_back(nodes[local]);
      if (!std::ranges::all_of(facet, [&](std::int32_t node) { return std::abs(x(node) - 0.5) < 1e-12; })) continue;
      between.numbers.push_back(10000 + std::int64_t(between.numbers.size()));
      between.nodes.insert(between.nodes.end(), facet.begin(), facet.end());
    }
  }
  mesh.blocks.push_back(right);
  if (has_elements) mesh.blocks.push_back(between);
  return mesh;
}

/// Folds elements of the interface. At order 1, the vertex in the middle of the cube passes its neighbour; above, nodes
/// of an edge pass the edge's end.
void fold_interface(HighOrderMesh& mesh) {
  const double width = mesh.order == 1 ? 0.25 : 0.125, centre = mesh.order == 1 ? 0.5 : 0.625;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    double* x = &mesh.coordinates[3 * node];
    double near = 1;
    for (int k = 0; k < 3; ++k) near *= std::max(0.0, 1 - std::abs(x[k] - (k == 1 ? centre : 0.5)) / width);
    x[1] += (mesh.order == 3 ? 0.8 : 1.2) * width * near;
  }
}

Expected<SlidOnGeometry> slid(HighOrderMesh& mesh, int threads = 1) {
  GeometryOptions options;
  options.slide_on = GeometrySource::Boundary;
  options.slide = SlideOn::All;
  options.threads = threads;
  return slide_on_boundary(mesh, options);
}

TEST(Interfaces, UnfoldWithoutAModel) {
  for (const Filling filling : {Filling::Hexahedra, Filling::Tetrahedra})
    for (const int order : {1, 2, 3}) {
      if (order == 1 && filling == Filling::Tetrahedra) continue;  // inverted triangles have themselves as targets
      const HighOrderMesh start = two_regions(filling, order);
      HighOrderMesh mesh = start;
      fold_interface(mesh);
      const auto done = slid(mesh);
      ASSERT_TRUE(done) << done.error().sentence;
      EXPECT_GT(done->report.folded_before, 0) << order;
      EXPECT_EQ(done->report.folded_after, 0) << order;
      for (std::size_t node = 0; node < mesh.node_count(); ++node)
        for (std::size_t k = 0; k < 3; ++k) {
          const double came = start.coordinates[3 * node + k];
          const bool is_held = came == 0 || came == 1 || (k == 0 && std::abs(came - 0.5) < 1e-12);
          if (is_held) {
            EXPECT_NEAR(mesh.coordinates[3 * node + k], came, 1e-13) << node;
          }
        }
      EXPECT_NE(done->sentences.front().find("1 of the surfaces is an interface"), std::string::npos)
          << done->sentences.front();
    }
}

TEST(Interfaces, HaveCurvesWhereTheyMeetTheBoundary) {
  const HighOrderMesh mesh = two_regions(Filling::Hexahedra, 2);
  const Team team(1);
  team.run([&] {
    const auto own = own_boundary(mesh, team);
    ASSERT_TRUE(own);
    EXPECT_EQ(own->inside, 1u);
    // Two of the cube's faces are whole, four are cut in two.
    EXPECT_EQ(own->association.geometry.surfaces.size(), 11u);
    EXPECT_EQ(own->association.geometry.curves.size(), 20u);
    EXPECT_EQ(own->association.geometry.vertices.size(), 12u);
    EXPECT_TRUE(own->association.held.empty());
  });
}

TEST(Interfaces, WithoutElementsHoldTheBoundaryBetweenTheRegions) {
  const HighOrderMesh start = two_regions(Filling::Hexahedra, 1, false);
  HighOrderMesh mesh = start;
  // A node of the boundary between the regions, which would slide back into its row.
  for (std::size_t node = 0; node < mesh.node_count(); ++node)
    if (start.coordinates[3 * node] == 0.5 && start.coordinates[3 * node + 1] == 0.5 &&
        start.coordinates[3 * node + 2] == 0)
      mesh.coordinates[3 * node + 1] += 0.1;
  const HighOrderMesh moved = mesh;
  ASSERT_TRUE(slid(mesh));
  for (std::size_t node = 0; node < mesh.node_count(); ++node)
    for (std::size_t k = 0; k < 3 && start.coordinates[3 * node] == 0.5; ++k)
      EXPECT_EQ(mesh.coordinates[3 * node + k], moved.coordinates[3 * node + k]) << node;
}

TEST(Interfaces, HaveTheSameBitsForAnyNumberOfThreads) {
  HighOrderMesh one = two_regions(Filling::Tetrahedra, 2), three = one;
  fold_interface(one);
  fold_interface(three);
  ASSERT_TRUE(slid(one, 1));
  ASSERT_TRUE(slid(three, 3));
  EXPECT_EQ(one.coordinates, three.coordinates);
}

}  // namespace
}  // namespace varimesh
