// VTK's node orders against Gmsh's, and the frame of a VTU file.
#include "core/formats/vtu/write.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/formats/numbering/node_order.h"
#include "core/formats/vtu/cells.h"
#include "core/reference/nodes.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;

constexpr Shape kCells[] = {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron,
                            Shape::Pyramid,  Shape::Prism,         Shape::Hexahedron};

TEST(VtkCell, TakesEveryNodeOnce) {
  for (const Shape shape : kCells)
    for (int order = 1; order <= 6; ++order) {
      if (shape == Shape::Pyramid && order > 1) continue;  // written as a hexahedron
      const formats::VtkCell cell = formats::vtk_cell(shape, order);
      EXPECT_EQ(int(cell.nodes.size()), reference::node_count(shape, order));
      const std::set<int> nodes(cell.nodes.begin(), cell.nodes.end());
      EXPECT_EQ(nodes.size(), cell.nodes.size()) << reference::info(shape).name << " of order " << order;
      EXPECT_EQ(*nodes.begin(), 0);
    }
}

TEST(VtkCell, PutsEachNodeAtItsLatticePosition) {
  for (const Shape shape :
       {Shape::Line, Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron, Shape::Prism, Shape::Hexahedron})
    for (int order = 1; order <= 6; ++order) {
      const formats::VtkCell cell = formats::vtk_cell(shape, order);
      const formats::Positions& positions = formats::node_positions(formats::NodeOrder::Vtk, shape, order);
      const auto& lattice = reference::lattice(shape, order);
      ASSERT_EQ(cell.nodes.size(), positions.size());
      for (std::size_t i = 0; i < positions.size(); ++i)
        for (std::size_t k = 0; k < 3; ++k) {
          // VTK's linear wedge is the mirror image of its Lagrange wedge.
          const std::size_t axis = cell.type == 13 && k < 2 ? 1 - k : k;
          EXPECT_EQ(positions[i][axis], lattice[std::size_t(cell.nodes[i])][k]);
        }
    }
}

TEST(VtkCell, WritesAPyramidAsAHexahedronWhoseTopIsTheApex) {
  const formats::VtkCell cell = formats::vtk_cell(Shape::Pyramid, 3);
  const formats::Positions& positions = formats::node_positions(formats::NodeOrder::Vtk, Shape::Pyramid, 3);
  ASSERT_EQ(cell.nodes.size(), 64U);
  EXPECT_EQ(cell.type, 72) << "VTK's Lagrange hexahedron";
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (positions[i][2] == 3) {
      EXPECT_EQ(cell.nodes[i], 4) << "the apex";
    } else if (positions[i][2] == 0) {
      EXPECT_GE(cell.nodes[i], 0) << "the base has all its nodes";
    }
  }
  EXPECT_EQ(std::ranges::count(cell.nodes, -1), 2 * 12) << "two layers of 16 with their four upright edges";
}

TEST(VtkCell, HasVtksOwnTypesAtOrderOne) {
  const std::pair<Shape, int> types[] = {{Shape::Triangle, 5},    {Shape::Quadrilateral, 9}, {Shape::Tetrahedron, 10},
                                         {Shape::Hexahedron, 12}, {Shape::Prism, 13},        {Shape::Pyramid, 14}};
  for (const auto& [shape, type] : types) EXPECT_EQ(formats::vtk_cell(shape, 1).type, type);
}

TEST(Vtu, AFieldOfTheWrongLengthIsRefused) {
  const double value = 1;
  const formats::CellField field{"x", {&value, 0}};
  EXPECT_FALSE(formats::write(test::one_cell(Shape::Triangle, 2), Format::Vtu, [](std::string_view) { return true; },
                              {&field, 1}));
}

TEST(Vtu, SaysWhatItLeavesOut) {
  HighOrderMesh mesh = testing::grid(testing::Filling::Triangles, {2, 1, 1}, 2);
  EXPECT_EQ(formats::left_out(mesh, Format::Vtu), "");
  mesh.blocks[0].numbers[0] = 1000;
  EXPECT_EQ(formats::left_out(mesh, Format::Vtu), "") << "the file has the numbers of elements";
  mesh.blocks[0].physical = {1, 2};
  mesh.physical_groups[1].name = mesh.physical_groups[0].name;
  mesh.blocks.push_back({Shape::Point, 2, 1, {1, 2}, {1001}, {0}, {}, {}});
  mesh.periodic.push_back({});
  mesh.node_numbers[0] = 1000;
  EXPECT_EQ(formats::left_out(mesh, Format::Vtu),
            "VTU's format has no place for 1 point, the second group of an element, a name that two groups have, "
            "periodic links and the numbers of nodes; the file leaves them out.");
  const auto back = formats::read(test::written(mesh, Format::Vtu));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->mesh.element_count(0), 0U);
  EXPECT_EQ(back->mesh.blocks[0].physical, std::vector{1});
  EXPECT_EQ(back->mesh.blocks[0].numbers[0], 1000);
  EXPECT_EQ(back->mesh.physical_groups.size(), mesh.physical_groups.size() - 1);
  EXPECT_EQ(back->mesh.periodic.size(), 0U);
  EXPECT_EQ(back->mesh.node_numbers[0], 1);
}

TEST(Vtu, DeclaresItsPointsCellsAndFields) {
  const double value = 7;
  const formats::CellField field{"a <b> & \"c\"", {&value, 1}};
  std::string bytes;
  ASSERT_TRUE(formats::write(test::one_cell(Shape::Triangle, 3), Format::Vtu,
                             [&](std::string_view piece) {
                               bytes += piece;
                               return true;
                             },
                             {&field, 1}));
  for (const char* words :
       {"<VTKFile type=\"UnstructuredGrid\" version=\"1.0\"", "NumberOfPoints=\"10\" NumberOfCells=\"1\"",
        "Name=\"element\"", "Name=\"physical\"", "Name=\"a &lt;b> &amp; &quot;c&quot;\"", "</VTKFile>"})
    EXPECT_NE(bytes.find(words), std::string::npos) << words;
}

}  // namespace
}  // namespace varimesh
