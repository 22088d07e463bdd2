// Which nodes may move: by default, by group, by number, by region. All others come back bit for bit.
#include "core/problem/fixed_nodes.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "core/mesh/changes/displacements.h"
#include "core/optimise/optimiser.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

std::vector<bool> fixed_with(const HighOrderMesh& mesh, const Options& options) {
  const auto fixed = choose_fixed_nodes(mesh, options);
  EXPECT_TRUE(fixed) << fixed.error().sentence;
  return fixed ? *fixed : std::vector<bool>{};
}

std::string refusal(const HighOrderMesh& mesh, const Options& options) {
  const auto fixed = choose_fixed_nodes(mesh, options);
  EXPECT_FALSE(fixed);
  if (fixed) return "taken";
  EXPECT_EQ(fixed.error().kind, Error::Kind::BadOption);
  return fixed.error().sentence;
}

bool holds(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::int32_t nodes_freed(const std::vector<bool>& before, const std::vector<bool>& after) {
  return std::int32_t(std::count(before.begin(), before.end(), true) - std::count(after.begin(), after.end(), true));
}

// A square of 4 × 4 squares with an interface of lines at x = 1/2, the group "baffle" with tag 9.
HighOrderMesh with_baffle(int order) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {4, 4, 0}, 1);
  mesh.physical_groups.push_back({1, 9, "baffle"});
  ElementBlock baffle;
  baffle.shape = Shape::Line;
  baffle.entity = 9;
  baffle.physical = {9};
  for (int j = 0; j < 4; ++j) {
    baffle.numbers.push_back(1000 + j);
    baffle.nodes.insert(baffle.nodes.end(), {2 + 5 * j, 2 + 5 * (j + 1)});
  }
  mesh.blocks.push_back(baffle);
  return *change_order(mesh, order);
}

TEST(ChooseFixedNodes, DefaultsToTheBoundaryAndInterfaces) {
  for (const Filling filling : testing::kFillings) {
    const HighOrderMesh mesh = testing::grid(filling, {3, 2, 2}, 3);
    EXPECT_EQ(fixed_with(mesh, {}), fixed_nodes(mesh)) << testing::name(filling);
  }
  EXPECT_EQ(fixed_with(with_baffle(3), {}), fixed_nodes(with_baffle(3)));
}

TEST(ChooseFixedNodes, AnInterfaceIsFreedExceptForItsEndsOnTheBoundary) {
  const HighOrderMesh mesh = with_baffle(3);
  const std::vector<bool> before = fixed_nodes(mesh);
  for (const char* name : {"baffle", "9", "1:9"}) {
    Options options;
    options.free = {name};
    // 13 nodes lie on the interface. Its two ends lie on the boundary too.
    EXPECT_EQ(nodes_freed(before, fixed_with(mesh, options)), 11) << name;
  }
}

TEST(ChooseFixedNodes, AnOuterBoundaryIsNotFreed) {
  const HighOrderMesh mesh = with_baffle(2);
  Options by_group;
  by_group.free = {"left"};
  EXPECT_TRUE(holds(refusal(mesh, by_group), "'left' cannot be freed"));
  Options by_number;
  by_number.free_nodes = {1};
  EXPECT_TRUE(holds(refusal(mesh, by_number), "Node 1 cannot be freed"));
}

TEST(ChooseFixedNodes, ANodeOfAnInterfaceIsFreedWithTheEdgesThatItBounds) {
  const HighOrderMesh mesh = with_baffle(3);
  Options options;
  options.free_nodes = {mesh.node_numbers[2 + 5 * 2]};  // the vertex in the middle
  // The vertex, and the inner nodes of the two lines that meet there.
  EXPECT_EQ(nodes_freed(fixed_nodes(mesh), fixed_with(mesh, options)), 1 + 2 * 2);
}

TEST(ChooseFixedNodes, GroupsOfAnyDimensionAreFixed) {
  HighOrderMesh mesh = testing::grid(Filling::MixedSolid, {3, 2, 2}, 2);
  mesh.physical_groups.push_back({3, 77, "cubes"});
  for (ElementBlock& block : mesh.blocks)
    if (block.shape == Shape::Hexahedron) block.physical = {77};
  Options options;
  options.fix = {"cubes"};
  const std::vector<bool> fixed = fixed_with(mesh, options);
  for (const ElementBlock& block : mesh.blocks) {
    if (block.shape != Shape::Hexahedron) continue;
    for (const std::int32_t node : block.nodes) EXPECT_TRUE(fixed[std::size_t(node)]);
  }
  EXPECT_LT(nodes_freed(fixed_nodes(mesh), fixed), 0);
  EXPECT_NE(std::count(fixed.begin(), fixed.end(), false), 0);
}

TEST(ChooseFixedNodes, ByNumberHoldsTheWholeEdge) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {3, 3, 0}, 4);
  testing::shake(mesh, 0.01, 2);
  const std::vector<bool> before = fixed_nodes(mesh);
  const Cells cells(mesh, 2);
  // The middle node of the first edge inside.
  std::int32_t node = -1;
  for (std::size_t cell = 0; cell < cells.count() && node < 0; ++cell)
    for (int local = 3; local < 12 && node < 0; ++local)
      if (!before[std::size_t(cells.nodes(cell)[std::size_t(local)])]) node = cells.nodes(cell)[std::size_t(local)];
  Options options;
  options.fix_nodes = {mesh.node_numbers[std::size_t(node)]};
  const std::vector<bool> fixed = fixed_with(mesh, options);
  const std::int32_t more = -nodes_freed(before, fixed);
  EXPECT_GE(more, 3);
  EXPECT_LE(more, 5);  // three nodes inside the edge, and those of its ends that are inside the square
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    for (std::size_t k = 0; k < 3; ++k) {
      if (!fixed[n]) continue;
      EXPECT_EQ(result->mesh.coordinates[3 * n + k], mesh.coordinates[3 * n + k]);
    }
  EXPECT_EQ(result->sizes.free_nodes, std::count(fixed.begin(), fixed.end(), false));
  EXPECT_EQ(summarise(mesh, options)->free_nodes, result->sizes.free_nodes);
}

TEST(ChooseFixedNodes, FixedGroupsStayFixedIfTheyAreFreedToo) {
  const HighOrderMesh mesh = with_baffle(2);
  Options options;
  options.free = {"baffle"};
  options.fix = {"baffle"};
  EXPECT_EQ(fixed_with(mesh, options), fixed_nodes(mesh));
}

TEST(ChooseFixedNodes, RefusesGroupsAndNodesThatAreNotThere) {
  HighOrderMesh mesh = with_baffle(2);
  Options options;
  options.fix = {"nozzle"};
  EXPECT_TRUE(holds(refusal(mesh, options), "no physical group 'nozzle'"));
  EXPECT_TRUE(holds(refusal(mesh, options), "'baffle'"));
  options = {};
  options.fix_nodes = {123456};
  EXPECT_TRUE(holds(refusal(mesh, options), "node 123456"));
  mesh.physical_groups.push_back({2, 9, "air"});
  options = {};
  options.free = {"9"};
  EXPECT_TRUE(holds(refusal(mesh, options), "1:9"));
  options.free = {"air"};
  EXPECT_TRUE(holds(refusal(mesh, options), "dimension 2"));
}

// === Regions =============================================================================================

class RegionBelow : public ::testing::TestWithParam<Filling> {};
INSTANTIATE_TEST_SUITE_P(Fillings, RegionBelow,
                         ::testing::Values(Filling::Triangles, Filling::Quadrilaterals, Filling::Tetrahedra,
                                           Filling::MixedSolid),
                         [](const auto& p) { return testing::name(p.param); });

// A mesh shaken a little everywhere, and much at one node.
HighOrderMesh spoilt(Filling filling) {
  HighOrderMesh mesh = testing::grid(filling, {14, 4, testing::is_plane(filling) ? 0 : 3}, 3);
  testing::shake(mesh, 0.0005, 4);
  const std::vector<bool> fixed = fixed_nodes(mesh), vertex = testing::vertex_nodes(mesh);
  std::size_t worst = 0;
  double nearest = 1e9;
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    if (fixed[n] || vertex[n]) continue;
    const double off = std::hypot(mesh.coordinates[3 * n] - 0.2, mesh.coordinates[3 * n + 1] - 0.25);
    if (off < nearest) nearest = off, worst = n;
  }
  mesh.coordinates[3 * worst] += 0.03;
  return mesh;
}

TEST_P(RegionBelow, MovesNoNodeOutsideItsRingsBitForBit) {
  const HighOrderMesh mesh = spoilt(GetParam());
  const CellQuality quality = cell_quality(mesh);
  const Cells cells(mesh, mesh.dimension);
  for (const int rings : {0, 1, 2}) {
    // The plain way: layers as sets of vertices.
    std::set<std::size_t> region;
    for (std::size_t cell = 0; cell < cells.count(); ++cell)
      if (quality.scaled_jacobian[cell] < 0.6) region.insert(cell);
    ASSERT_FALSE(region.empty());
    const auto vertices = [&](std::size_t cell) {
      return cells.nodes(cell).first(std::size_t(reference::info(cells.shape(cell)).vertices));
    };
    for (int ring = 0; ring < rings; ++ring) {
      std::set<std::int32_t> touched;
      for (const std::size_t cell : region) touched.insert(vertices(cell).begin(), vertices(cell).end());
      for (std::size_t cell = 0; cell < cells.count(); ++cell)
        for (const std::int32_t v : vertices(cell))
          if (touched.contains(v)) region.insert(cell);
    }
    ASSERT_LT(region.size(), cells.count());
    std::set<std::int32_t> held;
    for (std::size_t cell = 0; cell < cells.count(); ++cell)
      if (!region.contains(cell)) held.insert(cells.nodes(cell).begin(), cells.nodes(cell).end());

    Options options;
    options.region_below = 0.6;
    options.rings = rings;
    const auto result = optimise(mesh, options);
    ASSERT_TRUE(result) << result.error().sentence;
    for (const std::int32_t node : held)
      for (std::size_t k = 0; k < 3; ++k)
        ASSERT_EQ(result->mesh.coordinates[3 * std::size_t(node) + k], mesh.coordinates[3 * std::size_t(node) + k]);
    EXPECT_GT(testing::distance(result->mesh, mesh), 0.01) << "the bad node should move";
    EXPECT_GT(result->after.min_scaled_jacobian, result->before.min_scaled_jacobian);
  }
}

TEST(Region, OfMoreLayersThanThereAreIsTheWholeMesh) {
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {50'000, 1, 0}, 2);
  const Cells cells(mesh, 2);
  mesh.coordinates[3 * std::size_t(cells.nodes(0).back())] += 1e-5;  // the node inside the first cell, half as wide
  Options options;
  options.region_below = 0.5;
  options.rings = 3;
  const auto inside = [](const std::vector<bool>& fixed) { return std::count(fixed.begin(), fixed.end(), false); };
  EXPECT_EQ(inside(fixed_with(mesh, options)), 4 + 3) << "nodes in four cells, and on the edges between them";
  options.rings = std::numeric_limits<int>::max();
  EXPECT_EQ(fixed_with(mesh, options), fixed_with(mesh, {}));
}

TEST(EmptyRegion, LeavesAGoodMeshAsItIs) {
  const HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {4, 4, 0}, 3);
  Options options;
  options.region_below = 0.5;
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->mesh.coordinates, mesh.coordinates);
  EXPECT_EQ(result->sizes.free_nodes, 0);
}

// === Periodic boundaries, and a boundary given apart =====================================================

TEST(PeriodicBoundary, PairsStayAlike) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {3, 3, 3}, 1);
  PeriodicLink link{2, 2, 1, {}, {}};
  for (const std::int32_t node : testing::side_nodes(mesh, 2)) link.nodes.emplace_back(node, node - 3);
  mesh.periodic.push_back(link);
  mesh = *change_order(mesh, 3);
  ASSERT_FALSE(mesh.periodic[0].nodes.empty());
  testing::shake(mesh, 0.02, 8);
  const auto result = optimise(mesh);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_GT(testing::distance(result->mesh, mesh), 1e-3);
  const std::vector<double>& x = result->mesh.coordinates;
  for (const auto& [a, b] : result->mesh.periodic[0].nodes)
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(x[std::size_t(3 * a + k)] - x[std::size_t(3 * b + k)], k == 0 ? 1 : 0, 1e-14 * std::sqrt(3.0));
}

TEST(StraightMeshWithDisplacements, EndsAsTheCurvedMeshDoes) {
  for (const Filling filling : {Filling::MixedPlane, Filling::MixedSolid}) {
    HighOrderMesh straight = testing::grid(filling, {4, 3, 3}, 4);
    HighOrderMesh curved = straight;
    std::string list = "# number dx dy dz\n";
    for (const std::int32_t node : testing::side_nodes(straight, 3)) {
      double* x = curved.coordinates.data() + 3 * std::size_t(node);
      const double bump = 0.05 * std::sin(9 * x[0]);
      x[1] += bump;
      char line[100];
      std::snprintf(line, sizeof line, "%ld 0 %.17g 0\n", long(straight.node_numbers[std::size_t(node)]), bump);
      list += line;
    }
    const auto displacements = read_displacements(list, straight.dimension);
    ASSERT_TRUE(displacements) << displacements.error().sentence;
    ASSERT_TRUE(displace_boundary(straight, *displacements));
    const auto from_list = optimise(straight), from_mesh = optimise(curved);
    ASSERT_TRUE(from_list && from_mesh);
    EXPECT_GT(testing::distance(from_mesh->mesh, curved), 1e-3);
    EXPECT_LT(testing::distance(from_list->mesh, from_mesh->mesh), 1e-12);
  }
}

}  // namespace
}  // namespace varimesh
