// Neighbours across facets, and the nodes that are fixed on the boundary.
#include "core/mesh/connectivity.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

HighOrderMesh read_case(const std::string& name) {
  auto file = formats::read_file(test::source_file("tests/cases/" + name));
  EXPECT_TRUE(file) << file.error().sentence;
  return file ? file->mesh : HighOrderMesh{};
}

// The plain way: a map from sets of vertices to cells.
TEST(Facets, AgreeWithAMapOfVertexSets) {
  for (const char* name : {"sphere_p3.msh", "cylinder_p2.msh", "circle_p5.msh", "annulus_p3.msh"}) {
    const HighOrderMesh mesh = read_case(name);
    const Facets fast = facets(mesh);
    const Cells cells(mesh, mesh.dimension);
    const auto key = [&](std::size_t cell, std::size_t facet) {
      std::set<std::int32_t> vertices;
      for (int v : reference::info(cells.shape(cell)).facets[facet].vertices)
        if (v >= 0) vertices.insert(cells.nodes(cell)[std::size_t(v)]);
      return vertices;
    };
    std::map<std::set<std::int32_t>, std::set<std::int32_t>> plain;
    for (std::size_t c = 0; c < cells.count(); ++c)
      for (std::size_t f = 0; f < reference::info(cells.shape(c)).facets.size(); ++f)
        plain[key(c, f)].insert(std::int32_t(c));
    EXPECT_EQ(fast.crowded, -1);
    ASSERT_EQ(fast.first.size(), cells.count() + 1);
    for (std::size_t c = 0; c < cells.count(); ++c)
      for (std::size_t f = 0; f < reference::info(cells.shape(c)).facets.size(); ++f) {
        std::set<std::int32_t> others = plain[key(c, f)];
        others.erase(std::int32_t(c));
        const auto at = std::size_t(fast.first[c]) + f;
        EXPECT_EQ(fast.neighbour[at], others.empty() ? -1 : *others.begin());
        const std::int32_t opposite = fast.opposite[at];
        EXPECT_TRUE(opposite < 0 || std::size_t(fast.opposite[std::size_t(opposite)]) == at);
      }
  }
}

TEST(Facets, KnowTheirBoundaryElements) {
  const HighOrderMesh mesh = read_case("sphere_p3.msh");
  EXPECT_EQ(facets(mesh).elements.size(), mesh.element_count(2));
}

TEST(FixedNodes, OfTheNineTrianglesAreThoseOnTheOutline) {
  const HighOrderMesh mesh = read_case("nine_triangles.msh");
  const std::vector<bool> fixed = fixed_nodes(mesh);
  EXPECT_EQ(std::count(fixed.begin(), fixed.end(), true), 28);  // seven edges of four intervals
  EXPECT_FALSE(fixed[7]);                                       // the inner vertices
  EXPECT_FALSE(fixed[8]);
}

TEST(FixedNodes, NeedNoBoundaryElements) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  const std::vector<bool> with = fixed_nodes(mesh);
  mesh.blocks.erase(mesh.blocks.begin());
  EXPECT_EQ(fixed_nodes(mesh), with);
}

TEST(FixedNodes, InterfacesInTheFileAreFixedToo) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  // The edge B–M, inside, as a line of its own.
  const std::vector<std::int32_t>& nodes = mesh.blocks[1].nodes;
  mesh.blocks.push_back({Shape::Line, 4, 2, {}, {100}, {nodes[1], nodes[2], nodes[6], nodes[7], nodes[8]}, {}, {}});
  const std::vector<bool> fixed = fixed_nodes(mesh);
  EXPECT_EQ(std::count(fixed.begin(), fixed.end(), true), 28 + 4);
}

}  // namespace
}  // namespace varimesh
