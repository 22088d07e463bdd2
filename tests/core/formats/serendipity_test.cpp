// Serendipity elements go through every format that has them, and come back as they were.
#include "core/reference/serendipity.h"

#include <gtest/gtest.h>

#include "core/formats/common/reading_notes.h"
#include "core/formats/reading_notes.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/mesh/check.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::Filling;
using testing::read_back;

std::vector<Shape> shapes_of(Filling filling) {
  switch (filling) {
    case Filling::Tetrahedra:
    case Filling::Triangles:
      return {};
    case Filling::Quadrilaterals:
    case Filling::MixedPlane:
      return {Shape::Quadrilateral};
    default: {
      std::vector<Shape> shapes;
      for (const ElementBlock& block : testing::grid(filling, {2, 1, 1}, 2).blocks)
        if (reference::serendipity_node_count(block.shape, 2) > 0 &&
            std::find(shapes.begin(), shapes.end(), block.shape) == shapes.end())
          shapes.push_back(block.shape);
      std::sort(shapes.begin(), shapes.end());
      return shapes;
    }
  }
}

/// A curved mesh that is written with serendipity elements.
HighOrderMesh serendipity_grid(Filling filling, int order = 2) {
  HighOrderMesh mesh = testing::curved_grid(filling, order);
  formats::remember_serendipity(mesh, shapes_of(filling));
  return mesh;
}

class SerendipityFiles : public ::testing::TestWithParam<Filling> {};
INSTANTIATE_TEST_SUITE_P(EveryFilling, SerendipityFiles, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& p) { return testing::name(p.param); });

TEST_P(SerendipityFiles, ComeBackAsTheyWere) {
  const std::vector<Shape> shapes = shapes_of(GetParam());
  if (shapes.empty()) return;
  const HighOrderMesh mesh = serendipity_grid(GetParam());
  for (const formats::FormatInfo& info : formats::all()) {
    if (!info.readable || !info.writable) continue;
    if (formats::needs_hdf5(info.format) && !formats::has_hdf5()) continue;
    if (info.format == Format::Hopr && mesh.dimension == 2) continue;
    const bool has_them = formats::left_out(mesh, info.format).find("complete elements") == std::string::npos;
    EXPECT_EQ(has_them, info.extension == ".msh" || info.format == Format::Vtu || info.format == Format::Cgns);
    const std::string bytes = test::written(mesh, info.format);
    const HighOrderMesh back = read_back(bytes);
    SCOPED_TRACE(info.name);
    EXPECT_EQ(back.node_count(), mesh.node_count());
    EXPECT_EQ(formats::serendipity_of(back), has_them ? shapes : std::vector<Shape>());
    EXPECT_EQ(formats::reading_notes(back).size(), has_them ? 1U : 0U);
    const auto sound = check_structure(back);
    EXPECT_TRUE(sound) << sound.error().sentence;
    if (!has_them) continue;
    EXPECT_NE(bytes, test::written(testing::curved_grid(GetParam(), 2), info.format));
    EXPECT_EQ(test::written(back, info.format), bytes);
  }
}

TEST(SerendipityFiles, AreCompleteWhereAnInnerNodeMoved) {
  HighOrderMesh mesh = serendipity_grid(Filling::Hexahedra);
  EXPECT_EQ(formats::left_out(mesh, Format::Msh22), "");
  mesh.coordinates[3 * std::size_t(mesh.blocks.back().nodes.back())] += 0.01;
  EXPECT_NE(formats::left_out(mesh, Format::Msh22).find("are no longer where"), std::string::npos);
  const HighOrderMesh back = read_back(test::written(mesh, Format::Msh22));
  EXPECT_EQ(back.coordinates, mesh.coordinates);
  EXPECT_TRUE(formats::serendipity_of(back).empty());
}

TEST(SerendipityFiles, HaveTheOrdersOfTheirFormat) {
  const HighOrderMesh mesh = serendipity_grid(Filling::Hexahedra, 4);
  EXPECT_EQ(formats::left_out(mesh, Format::Msh22Binary), "");
  EXPECT_NE(formats::left_out(mesh, Format::Vtu).find("the format has no others"), std::string::npos);
  EXPECT_EQ(formats::serendipity_of(read_back(test::written(mesh, Format::Msh22Binary))),
            shapes_of(Filling::Hexahedra));
}

TEST(MixedOrders, AreRaisedByReading) {
  // A triangle of order 1 beside a quadrilateral of order 2.
  const std::string bytes =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 .5 -.1 0\n6 1 .5 0\n"
      "7 .5 1 0\n8 0 .5 0\n9 .5 .45 0\n20 2 0 0\n$EndNodes\n$Elements\n2\n1 10 2 1 1 1 2 3 4 5 6 7 8 9\n"
      "2 2 2 2 2 2 20 3\n$EndElements\n";
  const HighOrderMesh mesh = read_back(bytes);
  EXPECT_EQ(mesh.order, 2);
  EXPECT_EQ(mesh.node_count(), 12U) << "two edges of the triangle are its own";
  const auto sound = check_structure(mesh);
  EXPECT_TRUE(sound) << sound.error().sentence;
  ASSERT_EQ(formats::reading_notes(mesh).size(), 1U);
  EXPECT_EQ(
      formats::reading_notes(mesh)[0],
      "Elements of lower order became elements of order 2 with the same geometry: 1 triangle of order 1. The 2 new "
      "nodes have the numbers 21 to 22.");
}

/// CGNS has no triangle of nine nodes among the types that are written, so it becomes one of ten.
TEST(SerendipityFiles, AreCompleteWhereTheFormatHasNoSuchType) {
  if (!testing::use_hdf5()) GTEST_SKIP() << "SKIPPED: VariMesh is built without HDF5 (libhdf5-dev)";
  const std::string nine =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n9\n1 0 0 0\n2 3 0 0\n3 0 3 0\n4 1 0 0\n5 2 0 0\n6 2 1 0\n7 1 2 0\n"
      "8 0 2 0\n9 0 1 0\n$EndNodes\n$Elements\n1\n1 20 2 1 1 1 2 3 4 5 6 7 8 9\n$EndElements\n";
  const HighOrderMesh mesh = read_back(nine);
  ASSERT_EQ(mesh.node_count(), 10U);
  EXPECT_NE(formats::left_out(mesh, Format::Cgns).find("complete elements"), std::string::npos);
  const HighOrderMesh again = read_back(test::written(mesh, Format::Cgns));
  EXPECT_EQ(again.node_count(), 10U);
  EXPECT_EQ(again.element_count(2), 1U);
  EXPECT_EQ(test::written(mesh, Format::Msh22).find(" 21 "), std::string::npos) << "Gmsh has the type 20";
}

}  // namespace
}  // namespace varimesh
