// HOPR's meshes: every shape and order comes back as it went, with groups, boundary conditions and periodic sides.

#include <gtest/gtest.h>

#include <set>

#include "core/formats/hdf5/notes.h"
#include "core/mesh/connectivity.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::curved_grid;
using testing::Filling;
using testing::read_back;

/// Expects the same cells and sides with the same nodes, bit for bit.
void expect_same(const HighOrderMesh& a, const HighOrderMesh& b) {
  EXPECT_EQ(a.order, b.order);
  EXPECT_EQ(testing::distance(a, b), 0);
  const auto sides = [](const HighOrderMesh& mesh) {
    std::vector<std::pair<int, std::vector<double>>> all;
    const Cells cells(mesh, 2);
    for (std::size_t e = 0; e < cells.count(); ++e) {
      std::vector<double> x;
      for (const std::int32_t node : cells.nodes(e))
        for (std::size_t k = 0; k < 3; ++k) x.push_back(mesh.coordinates[3 * std::size_t(node) + k]);
      std::sort(x.begin(), x.end());
      const auto& physical = cells.range_of(e).block->physical;
      all.emplace_back(physical.empty() ? 0 : physical.front(), x);
    }
    std::sort(all.begin(), all.end());
    return all;
  };
  EXPECT_EQ(sides(a), sides(b));
}

class HoprShapes : public ::testing::TestWithParam<Filling> {};

TEST_P(HoprShapes, ComeBackBitForBit) {
  NEEDS_HDF5();
  for (int order = 1; order <= 5; ++order) {
    const HighOrderMesh mesh = curved_grid(GetParam(), order);
    const std::string bytes = test::written(mesh, Format::Hopr);
    const HighOrderMesh back = read_back(bytes);
    expect_same(mesh, back);
    EXPECT_EQ(back.node_numbers, mesh.node_numbers);
    ASSERT_EQ(back.physical_groups.size(), 6U);
    EXPECT_EQ(back.physical_groups[3].name, "back");
    EXPECT_EQ(test::written(back, Format::Hopr), bytes) << "the bytes of a file depend on its mesh only";
  }
}

INSTANTIATE_TEST_SUITE_P(EverySolid, HoprShapes,
                         ::testing::Values(Filling::Hexahedra, Filling::Prisms, Filling::Pyramids, Filling::Tetrahedra,
                                           Filling::MixedSolid),
                         [](const auto& info) { return std::string(testing::name(info.param)); });

TEST(Hopr, TakesEveryOrderOfEveryShape) {
  NEEDS_HDF5();
  for (const Shape shape : {Shape::Tetrahedron, Shape::Pyramid, Shape::Prism, Shape::Hexahedron})
    for (int order = 1; order <= kMaxOrder; ++order) {
      const HighOrderMesh mesh = test::one_cell(shape, order);
      const HighOrderMesh back = read_back(test::written(mesh, Format::Hopr));
      ASSERT_EQ(back.order, order);
      EXPECT_EQ(testing::distance(mesh, back), 0);
      EXPECT_EQ(back.element_count(2), reference::info(shape).facets.size()) << "sides without a group become one";
    }
}

TEST(Hopr, RefusesMeshesOfPlanes) {
  NEEDS_HDF5();
  EXPECT_NE(test::written(curved_grid(Filling::Triangles, 2), Format::Hopr).find("solids only"), std::string::npos);
}

TEST(Hopr, KeepsZonesAndTheCodesOfBoundaryConditions) {
  NEEDS_HDF5();
  HighOrderMesh mesh = curved_grid(Filling::Hexahedra, 2);
  for (ElementBlock& block : mesh.blocks)
    if (block.shape == Shape::Hexahedron) block.physical = {7};
  formats::remember_hopr_conditions(mesh, {{2, {3, 1, 4, 0}}});
  const HighOrderMesh back = read_back(test::written(mesh, Format::Hopr));
  EXPECT_EQ(formats::hopr_conditions_of(back)[2], (formats::HoprCondition{3, 1, 4, 0}));
  EXPECT_EQ(formats::hopr_conditions_of(back)[1], (formats::HoprCondition{2, 0, 0, 0}));
  for (const ElementBlock& block : back.blocks)
    if (block.shape == Shape::Hexahedron) {
      EXPECT_EQ(block.physical, std::vector{7});
    }
}

TEST(Hopr, KeepsTheLargestNumberOfAZone) {
  NEEDS_HDF5();
  HighOrderMesh mesh = test::one_cell(Shape::Hexahedron, 1);
  mesh.blocks[0].physical = {2147483647};
  EXPECT_EQ(read_back(test::written(mesh, Format::Hopr)).blocks.at(0).physical, std::vector{2147483647});
}

TEST(Hopr, GivesSidesWithoutAGroupANameOfTheirOwn) {
  NEEDS_HDF5();
  HighOrderMesh mesh = curved_grid(Filling::Hexahedra, 1);
  mesh.physical_groups[0].name = "boundary";
  std::erase_if(mesh.blocks, [](const ElementBlock& block) {
    return reference::info(block.shape).dimension == 2 && block.physical == std::vector{2};
  });
  const HighOrderMesh back = read_back(test::written(mesh, Format::Hopr));
  std::set<std::string> names;
  for (const PhysicalGroup& group : back.physical_groups)
    if (group.dimension == 2) {
      EXPECT_TRUE(names.insert(group.name).second) << group.name;
    }
  EXPECT_TRUE(names.contains("boundary"));
  EXPECT_TRUE(names.contains("boundary_2"));
}

/// Pairs of nodes on x = 0 and x = 1.
HighOrderMesh periodic_box(Filling filling, int order) {
  HighOrderMesh mesh = testing::grid(filling, {3, 2, 2}, order);
  PeriodicLink link{2, 1, 2, {}, {}};
  for (std::size_t a = 0; a < mesh.node_count(); ++a)
    for (std::size_t b = 0; b < mesh.node_count(); ++b) {
      const double* x = mesh.coordinates.data() + 3 * a;
      const double* y = mesh.coordinates.data() + 3 * b;
      if (std::abs(x[0]) + std::abs(y[0] - 1) + std::abs(x[1] - y[1]) + std::abs(x[2] - y[2]) < 1e-12)
        link.nodes.emplace_back(std::int32_t(a), std::int32_t(b));
    }
  mesh.periodic.push_back(link);
  return mesh;
}

TEST(Hopr, KeepsPeriodicSides) {
  NEEDS_HDF5();
  for (const Filling filling : {Filling::Hexahedra, Filling::Prisms, Filling::Tetrahedra})
    for (int order = 1; order <= 4; ++order) {
      const HighOrderMesh mesh = periodic_box(filling, order);
      ASSERT_EQ(mesh.periodic[0].nodes.size(), std::size_t((2 * order + 1) * (2 * order + 1)));
      HighOrderMesh back = read_back(test::written(mesh, Format::Hopr));
      ASSERT_EQ(back.periodic.size(), 1U);
      EXPECT_EQ(back.periodic[0].entity, 1);
      EXPECT_EQ(back.periodic[0].master, 2);
      ASSERT_EQ(back.periodic[0].nodes.size(), mesh.periodic[0].nodes.size());
      for (const auto& [node, master] : back.periodic[0].nodes)
        for (std::size_t k = 0; k < 3; ++k)
          EXPECT_NEAR(back.coordinates[3 * std::size_t(node) + k] + (k == 0 ? 1 : 0),
                      back.coordinates[3 * std::size_t(master) + k], 1e-12);
      EXPECT_EQ(formats::hopr_conditions_of(back)[1][0], formats::kHoprPeriodic);
    }
}

/// Gives the sides on x = 0, x = 1 and y = 0 one group; the link joins the first two.
HighOrderMesh periodic_in_one_group() {
  HighOrderMesh mesh = periodic_box(Filling::Hexahedra, 2);
  for (ElementBlock& block : mesh.blocks)
    if (block.physical == std::vector{2} || block.physical == std::vector{3}) block.physical = {1};
  mesh.periodic[0].master = 1;
  return mesh;
}

/// Expects one periodic link with as many pairs, and that exactly the groups `names` are periodic.
void expect_periodic(const HighOrderMesh& mesh, const HighOrderMesh& back, const std::set<std::string>& names) {
  ASSERT_EQ(back.periodic.size(), 1U);
  EXPECT_EQ(back.periodic[0].nodes.size(), mesh.periodic[0].nodes.size());
  EXPECT_NE(back.periodic[0].entity, back.periodic[0].master);
  std::set<std::string> periodic;
  const auto conditions = formats::hopr_conditions_of(back);
  for (const PhysicalGroup& group : back.physical_groups)
    if (group.dimension == 2 && conditions.at(group.tag)[0] == formats::kHoprPeriodic) periodic.insert(group.name);
  EXPECT_EQ(periodic, names);
}

TEST(Hopr, SplitsAGroupWithBothPeriodicSidesAndAWall) {
  NEEDS_HDF5();
  const HighOrderMesh mesh = periodic_in_one_group();
  const HighOrderMesh back = read_back(test::written(mesh, Format::Hopr));
  expect_periodic(mesh, back, {"left_periodic_1_first", "left_periodic_1_second"});
  const auto count = [&](int tag) {
    std::size_t sides = 0;
    for (const ElementBlock& block : back.blocks)
      if (block.physical == std::vector{tag}) sides += block.size();
    return sides;
  };
  EXPECT_EQ(back.physical_groups[0].name, "left");
  EXPECT_EQ(count(1), 6U) << "the wall";
  EXPECT_EQ(formats::hopr_conditions_of(back)[1], (formats::HoprCondition{2, 0, 0, 0}));
  EXPECT_EQ(count(7) + count(8), 8U) << "the periodic sides";
}

TEST(Hopr, KeepsPeriodicSidesWithoutGroups) {
  NEEDS_HDF5();
  HighOrderMesh mesh = periodic_box(Filling::Tetrahedra, 2);
  std::erase_if(mesh.blocks, [](const ElementBlock& block) { return reference::info(block.shape).dimension == 2; });
  mesh.physical_groups.clear();
  const HighOrderMesh back = read_back(test::written(mesh, Format::Hopr));
  expect_periodic(mesh, back, {"boundary_periodic_1_first", "boundary_periodic_1_second"});
}

TEST(Hopr, LeavesNoEmptyGroupWhereAllSidesWerePeriodic) {
  NEEDS_HDF5();
  HighOrderMesh mesh = periodic_in_one_group();
  for (ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == 2) {
      const bool periodic = std::all_of(block.nodes.begin(), block.nodes.end(), [&](std::int32_t node) {
        const double x = mesh.coordinates[3 * std::size_t(node)];
        return x < 1e-12 || x > 1 - 1e-12;
      });
      block.physical = {periodic ? 1 : 3};
    }
  const HighOrderMesh back = read_back(test::written(mesh, Format::Hopr));
  expect_periodic(mesh, back, {"left_periodic_1_first", "left_periodic_1_second"});
  EXPECT_EQ(back.physical_groups[0].name, "left_periodic_1_first") << "no group stays without sides";
}

TEST(Hopr, SaysWhatItLeavesOut) {
  HighOrderMesh mesh = curved_grid(Filling::Tetrahedra, 2);
  EXPECT_EQ(formats::left_out(mesh, Format::Hopr), "");
  mesh.blocks.push_back({Shape::Triangle, 2, 9, {9}, {999}, {0, 1, 2, 3, 4, 5}, {}, {}});
  EXPECT_EQ(
      formats::left_out(mesh, Format::Hopr),
      "HOPR's format has no place for 1 boundary element that is no side of an element; the file leaves them out.");
  mesh.blocks.pop_back();
  mesh.physical_groups.push_back({3, 1, "fluid"});
  mesh.entities.push_back({});
  EXPECT_EQ(
      formats::left_out(mesh, Format::Hopr),
      "HOPR's format has no place for names of groups of cells and entities of the geometry; the file leaves them "
      "out.");
}

}  // namespace
}  // namespace varimesh
