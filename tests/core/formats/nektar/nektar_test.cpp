// Nektar++'s files: every shape and order comes back as it went, and so do groups.
#include "core/formats/nektar/nektar.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/formats/nektar/grid.h"
#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::curved_grid;
using testing::Filling;
using testing::read_back;

std::string as_text(HighOrderMesh mesh) {
  mesh.foreign.push_back({"text", "", "nektar"});
  return test::written(mesh, Format::Nektar);
}

/// The nodes of each element, sorted by coordinates: Nektar++ turns cells. Inner nodes of 3-D cells are left out.
std::vector<std::vector<testing::Place>> outlines(const HighOrderMesh& mesh, int dimension) {
  std::vector<std::vector<testing::Place>> all;
  const Cells cells(mesh, dimension);
  for (std::size_t e = 0; e < cells.count(); ++e) {
    std::vector<testing::Place> own;
    const auto& places = reference::node_places(cells.shape(e), mesh.order);
    for (std::size_t i = 0; i < cells.nodes(e).size(); ++i) {
      const double* x = mesh.coordinates.data() + 3 * std::size_t(cells.nodes(e)[i]);
      if (places[i].dimension < 3) own.push_back({x[0], x[1], x[2]});
    }
    std::sort(own.begin(), own.end());
    all.push_back(own);
  }
  // Sides come group by group.
  if (dimension < mesh.dimension) std::sort(all.begin(), all.end());
  return all;
}

class NektarShapes : public ::testing::TestWithParam<Filling> {};

TEST_P(NektarShapes, EdgesAndFacesComeBackBitForBit) {
  for (int order = 1; order <= 5; ++order) {
    const HighOrderMesh mesh = curved_grid(GetParam(), order);
    for (const std::string& bytes : {test::written(mesh, Format::Nektar), as_text(mesh)}) {
      const HighOrderMesh back = read_back(bytes);
      const auto sound = check_structure(back);
      ASSERT_TRUE(sound) << sound.error().sentence;
      EXPECT_EQ(back.order, order);
      for (const int d : {mesh.dimension, mesh.dimension - 1}) EXPECT_EQ(outlines(mesh, d), outlines(back, d));
      EXPECT_EQ(back.physical_groups.size(), mesh.physical_groups.size());
      // Once it has Nektar++'s interiors and numbers, nothing changes any more.
      EXPECT_EQ(test::written(back, Format::Nektar), bytes);
      EXPECT_EQ(formats::left_out(back, Format::Nektar), "");
    }
  }
}

TEST_P(NektarShapes, CellsOfDegreeTwoComeBackWithTheirInterior) {
  for (int order = 2; order <= 5; ++order) {
    HighOrderMesh mesh = testing::grid(GetParam(), {2, 2, 1}, order);
    testing::move_nodes(mesh, [&](testing::Place at) {
      const auto [x, y, z] = at;
      return testing::Place{x + 0.1 * y * y, y + 0.1 * x * x, mesh.dimension == 3 ? z + 0.1 * x * y : 0};
    });
    EXPECT_EQ(formats::left_out(mesh, Format::Nektar).find("another interior"), std::string::npos);
    const HighOrderMesh back = read_back(test::written(mesh, Format::Nektar));
    double gap = 0;
    for (std::size_t node = 0; node < back.node_count(); ++node) {
      double least = 1;
      for (std::size_t other = 0; other < mesh.node_count(); ++other) {
        double own = 0;
        for (std::size_t k = 0; k < 3; ++k)
          own = std::max(own, std::abs(back.coordinates[3 * node + k] - mesh.coordinates[3 * other + k]));
        least = std::min(least, own);
      }
      gap = std::max(gap, least);
    }
    EXPECT_LE(gap, 1e-14) << "of order " << order;
  }
}

/// A file without its curves that begin like this, except for the first `kept`.
std::string without_curves(const std::string& file, const std::string& begin, int kept) {
  std::string less;
  bool curved = false;
  for (std::size_t at = 0, end = 0; at < file.size(); at = end) {
    end = file.find('\n', at) + 1;
    const std::string line = file.substr(at, end - at);
    curved = (curved || line.find("<CURVED>") != std::string::npos) && line.find("</CURVED>") == std::string::npos;
    if (!curved || line.find(begin) == std::string::npos || kept-- > 0) less += line;
  }
  return less;
}

TEST_P(NektarShapes, WhatHasNoCurveFollowsFromItsBoundary) {
  for (const int order : {3, 4}) {
    // Edges are straight.
    const HighOrderMesh straight = testing::grid(GetParam(), {2, 2, 2}, order);
    const std::string few = without_curves(without_curves(as_text(straight), "<F ID", 0), "<E ID", 1);
    EXPECT_NE(few.find("EDGEID"), std::string::npos);
    EXPECT_EQ(few.find("FACEID"), std::string::npos);
    EXPECT_LE(testing::distance(read_back(as_text(straight)), read_back(few)), 1e-14) << "of order " << order;
    // Faces continue their edges in another way than the mesh does, but always in the same way.
    const HighOrderMesh curved = read_back(without_curves(as_text(curved_grid(GetParam(), order)), "<F ID", 1));
    EXPECT_TRUE(check_structure(curved));
    EXPECT_EQ(testing::distance(curved, read_back(test::written(curved, Format::Nektar))), 0);
  }
}

TEST_P(NektarShapes, ChainWithGmshsFormatsAndMfem) {
  for (int order = 1; order <= 5; ++order) {
    const HighOrderMesh mesh = read_back(test::written(curved_grid(GetParam(), order), Format::Nektar));
    for (const Format other : {Format::Msh22, Format::Msh41Binary}) {
      const HighOrderMesh back = read_back(test::written(read_back(test::written(mesh, other)), Format::Nektar));
      for (const int d : {mesh.dimension, mesh.dimension - 1}) EXPECT_EQ(outlines(mesh, d), outlines(back, d));
      EXPECT_EQ(back.physical_groups.size(), mesh.physical_groups.size());
    }
    const HighOrderMesh back = read_back(test::written(read_back(test::written(mesh, Format::Mfem)), Format::Nektar));
    EXPECT_LE(testing::distance(mesh, back), 1e-13);
  }
}

TEST_P(NektarShapes, TrianglesCollapseTowardsOneVertexInBothCells) {
  const HighOrderMesh mesh = testing::grid(GetParam(), {5, 2, 2}, 1);
  const auto vertices = formats::nektar_vertices(mesh);
  ASSERT_TRUE(vertices) << vertices.error().sentence;
  const formats::NektarGrid grid(mesh, *vertices);
  grid.for_cells(0, grid.cells.count(), [&](std::size_t, Shape shape, std::span<const std::int32_t> own) {
    for (const reference::Facet& face : formats::faces_of(formats::Sides::Nektar, shape)) {
      if (face.shape != Shape::Triangle) continue;
      // Nektar++ takes the last vertex of each of its faces for the one to collapse to.
      const auto at = [&](std::size_t v) { return own[std::size_t(face.vertices[v])]; };
      EXPECT_GT(at(2), std::max(at(0), at(1)));
    }
  });
}

INSTANTIATE_TEST_SUITE_P(EveryShape, NektarShapes, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return std::string(testing::name(info.param)); });

TEST(Nektar, TakesEveryOrderOfEveryShape) {
  for (const Shape shape : {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron, Shape::Prism, Shape::Hexahedron})
    for (const int order : {6, 10}) {
      const HighOrderMesh mesh = test::one_cell(shape, order);
      EXPECT_EQ(outlines(mesh, mesh.dimension),
                outlines(read_back(test::written(mesh, Format::Nektar)), mesh.dimension));
    }
}

TEST(Nektar, SaysHowManyInteriorsItChanges) {
  HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {2, 1, 1}, 3);
  testing::shake(mesh, 0.02, 1);
  EXPECT_NE(formats::left_out(mesh, Format::Nektar).find("2 cells get another interior"), std::string::npos)
      << formats::left_out(mesh, Format::Nektar);
}

TEST(Nektar, ReadsGaussLobattoPoints) {
  const std::string line = "0 0 0  0.27639320225002106 0 0  0.7236067977499789 0 0  1 0 0";
  std::string text =
      "<NEKTAR><GEOMETRY DIM=\"2\" SPACE=\"2\"><VERTEX><V ID=\"0\">0 0 0</V><V ID=\"1\">1 0 0</V>"
      "<V ID=\"2\">0 1 0</V></VERTEX><EDGE><E ID=\"0\">0 1</E><E ID=\"1\">1 2</E><E ID=\"2\">2 0</E>"
      "</EDGE><ELEMENT><T ID=\"0\">0 1 2</T></ELEMENT><CURVED><E ID=\"0\" EDGEID=\"0\" NUMPOINTS=\"4\" "
      "TYPE=\"GaussLobattoLegendre\">" +
      line + "</E></CURVED><COMPOSITE><C ID=\"0\"> T[0] </C></COMPOSITE></GEOMETRY></NEKTAR>";
  const HighOrderMesh mesh = read_back(text);
  ASSERT_EQ(mesh.order, 3);
  EXPECT_NEAR(mesh.coordinates[3 * 3], 1.0 / 3, 1e-15) << "the first node inside the first edge";
  EXPECT_NEAR(mesh.coordinates[3 * 4], 2.0 / 3, 1e-15);
}

TEST(Nektar, ReadsCompressedListsThatNekMeshWrote) {
  // Four squares, in the form in which NekMesh writes files.
  const std::string file =
      "<NEKTAR><GEOMETRY DIM=\"2\" SPACE=\"2\"><VERTEX COMPRESSED=\"B64Z-LittleEndian\" BITSIZE=\"64\">"
      "eJxjYEAGD/aj0gwMjAzYAEKeCas8AjDj0AcDLNjNt4exWLG7Dy7PhlUfwh52HObCAAd2/XB1AAerEJkA</VERTEX>"
      "<EDGE COMPRESSED=\"B64Z-LittleEndian\" BITSIZE=\"64\">"
      "eJxjYEAFjDhoJhw0Mw4aBljQ1MP4rDj4bGh8mHnsaO6BqeNA48PUcaLxYfZzoYnD9HOj8WHuAgBAqACe</EDGE>"
      "<ELEMENT><Q COMPRESSED=\"B64Z-LittleEndian\" BITSIZE=\"64\">"
      "eJxjYEAFjFCaCUoz4xBngdKsUJoNTZ4dSnNAaU40c5jRxLmgNDea+QAUwABZ</Q></ELEMENT>"
      "<COMPOSITE><C ID=\"0\"> Q[0-3] </C><C ID=\"1\"> E[0,3,5,6,7,8,10,11] </C></COMPOSITE>"
      "<DOMAIN> C[0] </DOMAIN></GEOMETRY><EXPANSIONS><E COMPOSITE=\"C[0]\" NUMMODES=\"9\" FIELDS=\"u\" "
      "TYPE=\"MODIFIED\"/></EXPANSIONS></NEKTAR>";
  const HighOrderMesh mesh = read_back(file);
  EXPECT_EQ(mesh.element_count(2), 4U);
  EXPECT_EQ(mesh.element_count(1), 8U);
  EXPECT_TRUE(check_structure(mesh));
  EXPECT_EQ(mesh.blocks[0].physical, std::vector<int>{2}) << "composite 0 has the first free tag";
  EXPECT_EQ(mesh.blocks[1].physical, std::vector<int>{1});
  const std::string again = test::written(mesh, Format::Nektar);
  EXPECT_NE(again.find("<C ID=\"0\"> Q[0-3] </C>"), std::string::npos) << again;
  EXPECT_NE(again.find("NUMMODES=\"9\""), std::string::npos) << "the expansions stay";
  EXPECT_EQ(test::written(read_back(again), Format::Nektar), again);
}

// === Groups ==============================================================================================

TEST(Nektar, KeepsNamesThatXmlCannotHoldReadable) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {1, 1, 1}, 2);
  mesh.physical_groups[0].name = "a<&\">\t\n\r\x1b[31m\xff\xef\xbf\xbe\xef\xbf\xbf\xef\xbf\xbd";
  for (const Format format : {Format::Nektar, Format::Vtu}) {
    const HighOrderMesh back = read_back(test::written(mesh, format));
    EXPECT_TRUE(std::any_of(back.physical_groups.begin(), back.physical_groups.end(), [](const PhysicalGroup& group) {
      return group.name == "a<&\">\t\n\r\\x1b[31m\\xff\\ufffe\\uffff\xef\xbf\xbd";
    }));
  }
  mesh.physical_groups[0].name = std::string("a\0b", 3);
  EXPECT_NE(as_text(mesh).find("NAME=\"a\\x00b\""), std::string::npos);
}

TEST(Nektar, RefusesElementsWithANodeAsTwoVertices) {
  HighOrderMesh mesh = test::one_cell(Shape::Quadrilateral, 1);
  mesh.blocks[0].nodes[3] = mesh.blocks[0].nodes[2];
  const auto refused = formats::write(mesh, Format::Nektar, [](std::string_view) { return true; });
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().sentence.find("has a node as two of its vertices"), std::string::npos);
}

TEST(Nektar, CarriesTheNamesOfGroups) {
  const HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {2, 1, 1}, 2);
  const std::string bytes = as_text(mesh);
  EXPECT_NE(bytes.find("<C ID=\"1\" NAME=\"left\"> F["), std::string::npos) << bytes;
  const HighOrderMesh back = read_back(bytes);
  ASSERT_EQ(back.physical_groups.size(), 6U);
  const auto right = std::find_if(back.physical_groups.begin(), back.physical_groups.end(),
                                  [](const PhysicalGroup& group) { return group.tag == 2; });
  ASSERT_NE(right, back.physical_groups.end());
  EXPECT_EQ(right->name, "right");
  EXPECT_EQ(right->dimension, 2);
  EXPECT_TRUE(back.blocks[0].physical.empty()) << "cells in no group stay in none";
}

TEST(Nektar, KeepsElementsInSeveralGroups) {
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {2, 1, 1}, 1);
  ASSERT_EQ(mesh.blocks[0].shape, Shape::Quadrilateral);
  mesh.blocks[0].physical = {5, 9};
  mesh.physical_groups.push_back({2, 9, "a & b"});
  const std::string bytes = as_text(mesh);
  EXPECT_NE(bytes.find("<C ID=\"9\" NAME=\"a &amp; b\"> Q[0-1] </C>"), std::string::npos) << bytes;
  const HighOrderMesh back = read_back(bytes);
  EXPECT_EQ(back.blocks[0].physical, (std::vector<int>{5, 9}));
  EXPECT_EQ(as_text(back), bytes);
}

TEST(Nektar, SaysWhatItLeavesOut) {
  HighOrderMesh mesh = read_back(test::written(testing::grid(Filling::Tetrahedra, {1, 1, 1}, 2), Format::Nektar));
  EXPECT_EQ(formats::left_out(mesh, Format::Nektar), "");
  mesh.periodic.push_back({});
  mesh.entities.push_back({});
  mesh.node_numbers[0] = 777;
  EXPECT_EQ(formats::left_out(mesh, Format::Nektar),
            "Nektar++'s format has no place for periodic links, entities of the geometry and the numbers of nodes and "
            "elements; the file leaves them out.");
}

TEST(Nektar, FacesOfSeveralShapesTakeNoMoreMemoryThanTheyNeed) {
  // The room for the second list of faces was guessed from the first as well: hundreds of times too much.
  const HighOrderMesh mesh = testing::grid(Filling::Prisms, {200, 200, 3}, 1);
  const HighOrderMesh back = read_back(test::written(mesh, Format::Nektar));
  EXPECT_EQ(back.node_count(), mesh.node_count());
  EXPECT_EQ(Cells(back, 3).count(), Cells(mesh, 3).count());
}

}  // namespace
}  // namespace varimesh
