// CGNS files: every shape and order comes back as it went, with groups and boundary conditions.

#include <gtest/gtest.h>

#include "core/formats/hdf5/notes.h"
#include "core/formats/numbering/cgns_order.h"
#include "core/mesh/connectivity.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using formats::NodeOrder;
using formats::Positions;
using testing::curved_grid;
using testing::Filling;
using testing::read_back;

class CgnsShapes : public ::testing::TestWithParam<Filling> {};

TEST_P(CgnsShapes, ComeBackBitForBit) {
  NEEDS_HDF5();
  for (int order = 1; order <= 4; ++order) {
    const HighOrderMesh mesh = curved_grid(GetParam(), order);
    const std::string bytes = test::written(mesh, Format::Cgns);
    const HighOrderMesh back = read_back(bytes);
    EXPECT_EQ(back.coordinates, mesh.coordinates);
    EXPECT_EQ(back.dimension, mesh.dimension);
    EXPECT_EQ(back.order, order);
    for (const int d : {mesh.dimension, mesh.dimension - 1}) {
      const Cells from(mesh, d), to(back, d);
      ASSERT_EQ(from.count(), to.count());
      for (std::size_t e = 0; e < from.count(); ++e) {
        ASSERT_EQ(from.shape(e), to.shape(e));
        ASSERT_TRUE(std::ranges::equal(from.nodes(e), to.nodes(e)));
        EXPECT_EQ(from.range_of(e).block->physical, to.range_of(e).block->physical);
      }
    }
    ASSERT_EQ(back.physical_groups.size(), mesh.physical_groups.size());
    for (std::size_t i = 0; i < mesh.physical_groups.size(); ++i)
      EXPECT_EQ(back.physical_groups[i].name, mesh.physical_groups[i].name);
    EXPECT_EQ(test::written(back, Format::Cgns), bytes) << "the bytes of a file depend on its mesh only";
  }
}

INSTANTIATE_TEST_SUITE_P(EveryShape, CgnsShapes, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return std::string(testing::name(info.param)); });

TEST(Cgns, HasNoOrdersAboveFour) {
  NEEDS_HDF5();
  EXPECT_NE(test::written(curved_grid(Filling::Triangles, 5), Format::Cgns).find("up to order 4"), std::string::npos);
}

TEST(Cgns, CarriesLongNamesTagsGroupsOfCellsAndTypes) {
  NEEDS_HDF5();
  HighOrderMesh mesh = curved_grid(Filling::MixedSolid, 2);
  const std::string name =
      "the wall / of the eastern boundary, \xc3\xbc"
      "ber alles long";
  for (PhysicalGroup& group : mesh.physical_groups)
    if (group.tag == 2) group.name = name;
  mesh.physical_groups.push_back({3, 40, "fluid"});
  mesh.physical_groups.push_back({3, 50, "solid"});
  int turn = 0;
  for (ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == 3) block.physical = {++turn % 2 == 0 ? 40 : 50};
  formats::remember_cgns_types(mesh, {{2, "BCWallViscous"}});
  const HighOrderMesh back = read_back(test::written(mesh, Format::Cgns));
  std::map<std::pair<int, int>, std::string> names;
  for (const PhysicalGroup& group : back.physical_groups) names[{group.dimension, group.tag}] = group.name;
  EXPECT_EQ((names[{2, 2}]), name);
  EXPECT_EQ((names[{3, 40}]), "fluid");
  EXPECT_EQ((names[{3, 50}]), "solid");
  EXPECT_EQ(formats::cgns_types_of(back)[2], "BCWallViscous");
  const Cells from(mesh, 3), to(back, 3);
  for (std::size_t e = 0; e < from.count(); ++e)
    EXPECT_EQ(from.range_of(e).block->physical, to.range_of(e).block->physical);
}

TEST(Cgns, KeepsGroupsOfCellsThatAreCalledLikeSections) {
  NEEDS_HDF5();
  HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {5, 1, 1}, 1);
  const std::vector<std::string> names = {"Hexahedra_1", "Quadrilaterals_2", "GridCoordinates", "ZoneBC", "ZoneType"};
  const auto cells = std::find_if(mesh.blocks.begin(), mesh.blocks.end(),
                                  [](const ElementBlock& block) { return block.shape == Shape::Hexahedron; });
  ASSERT_EQ(cells->size(), names.size()) << "one block has all cells";
  const ElementBlock all = *cells;
  mesh.blocks.erase(cells);
  for (std::size_t e = 0; e < names.size(); ++e) {
    const auto nodes = all.nodes.begin() + std::ptrdiff_t(8 * e);
    mesh.blocks.push_back(
        {Shape::Hexahedron, 1, 1, {int(e) + 20}, {all.numbers[e]}, std::vector(nodes, nodes + 8), {}, {}});
    mesh.physical_groups.push_back({3, int(e) + 20, names[e]});
  }
  const HighOrderMesh back = read_back(test::written(mesh, Format::Cgns));
  std::vector<std::string> found;
  for (const PhysicalGroup& group : back.physical_groups)
    if (group.dimension == 3) found.push_back(group.name);
  EXPECT_EQ(found, names);
}

// Spelled out from the tables of the SIDS for HEXA_27, PENTA_40 and QUAD_25, not from the rules of the code.
TEST(Cgns, HasTheNodeOrderOfItsDocumentation) {
  const auto at = [](Shape shape, int order, std::size_t node) {
    return formats::node_positions(NodeOrder::Cgns, shape, order)[node - 1];
  };
  using P = formats::Position;
  // HEXA_27: mid-edge nodes 9 to 20, mid-face nodes 21 to 26, node 27 inside.
  EXPECT_EQ(at(Shape::Hexahedron, 2, 12), (P{0, 1, 0}));
  EXPECT_EQ(at(Shape::Hexahedron, 2, 13), (P{0, 0, 1}));
  EXPECT_EQ(at(Shape::Hexahedron, 2, 17), (P{1, 0, 2}));
  EXPECT_EQ(at(Shape::Hexahedron, 2, 21), (P{1, 1, 0}));
  EXPECT_EQ(at(Shape::Hexahedron, 2, 22), (P{1, 0, 1}));
  EXPECT_EQ(at(Shape::Hexahedron, 2, 25), (P{0, 1, 1}));
  EXPECT_EQ(at(Shape::Hexahedron, 2, 26), (P{1, 1, 2}));
  // PENTA_40: face nodes 25 to 38 (the triangle below, three quadrilaterals, the triangle above), nodes 39 and 40
  // inside.
  EXPECT_EQ(at(Shape::Prism, 3, 25), (P{1, 1, 0}));
  EXPECT_EQ(at(Shape::Prism, 3, 27), (P{2, 0, 1}));
  EXPECT_EQ(at(Shape::Prism, 3, 28), (P{2, 0, 2}));
  EXPECT_EQ(at(Shape::Prism, 3, 34), (P{0, 2, 1}));
  EXPECT_EQ(at(Shape::Prism, 3, 38), (P{1, 1, 3}));
  EXPECT_EQ(at(Shape::Prism, 3, 40), (P{1, 1, 2}));
  // QUAD_25: the nodes inside follow a spiral, 17 to 25.
  const Positions spiral{{1, 1, 0}, {2, 1, 0}, {3, 1, 0}, {3, 2, 0}, {3, 3, 0},
                         {2, 3, 0}, {1, 3, 0}, {1, 2, 0}, {2, 2, 0}};
  const Positions& quad = formats::node_positions(NodeOrder::Cgns, Shape::Quadrilateral, 4);
  EXPECT_EQ(Positions(quad.begin() + 16, quad.end()), spiral);
}

TEST(Cgns, KnowsTheTypesOfElements) {
  for (int type = 0; type < 60; ++type)
    if (const auto found = formats::cgns_element(type)) {
      ElementBlock one{found->shape, found->order, 1, {}, {1}, {}, {}, {}};
      one.nodes.resize(found->nodes);
      EXPECT_EQ(formats::cgns_type(one), type);
    }
  EXPECT_EQ(formats::cgns_type(Shape::Hexahedron, 4), 56);
  EXPECT_EQ(formats::cgns_element(18)->nodes, 20U);
  EXPECT_FALSE(formats::cgns_element(38)) << "HEXA_56 has nodes inside its faces, but not inside its volume";
}

TEST(Cgns, SaysWhatItLeavesOut) {
  HighOrderMesh mesh = curved_grid(Filling::Tetrahedra, 2);
  // The grid's elements are numbered with the cells first, as the file has them, or are given such numbers here.
  std::int64_t next = 0;
  for (const int d : {3, 2})
    for (ElementBlock& block : mesh.blocks)
      if (reference::info(block.shape).dimension == d)
        for (std::int64_t& number : block.numbers) number = ++next;
  EXPECT_EQ(formats::left_out(mesh, Format::Cgns), "");
  mesh.periodic.push_back({});
  mesh.node_numbers[0] = 1000;
  EXPECT_EQ(
      formats::left_out(mesh, Format::Cgns),
      "VariMesh's CGNS file has no place for periodic links and the numbers of nodes and elements; the file leaves "
      "them out.");
}

}  // namespace
}  // namespace varimesh
