// Abaqus' input files: elements with their nodes in the order of Abaqus' manual, sets and surfaces, and bad files.
#include "core/formats/abaqus/abaqus.h"

#include <gtest/gtest.h>

#include "core/formats/reading_notes.h"
#include "core/mesh/check.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/listed_elements.h"

namespace varimesh {
namespace {

using testing::Filling;

struct Type {
  Shape shape;
  std::string linear, quadratic, order;
};

/// The nodes as the manual lists them.
const std::vector<Type> kTypes = {
    {Shape::Triangle, "CPS3", "CPE6M", "0 1 2 01 12 20"},
    {Shape::Quadrilateral, "CPS4R", "S9R5", "0 1 2 3 01 12 23 30 0123"},
    {Shape::Tetrahedron, "C3D4", "C3D10M", "0 1 2 3 01 12 20 03 13 23"},
    {Shape::Hexahedron, "C3D8R", "C3D27",
     "0 1 2 3 4 5 6 7 01 12 23 30 45 56 67 74 04 15 26 37 01234567 0123 4567 0154 1265 2376 3047"}};

std::string file_of(const HighOrderMesh& mesh) {
  std::ostringstream out;
  out.precision(17);
  out << "** made by a test\n*Heading\n a title\n*NODE, NSET=ALL\n";
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    out << 10 * (mesh.node_count() - n) << ", " << mesh.coordinates[3 * n] << ",\t" << mesh.coordinates[3 * n + 1]
        << ", " << mesh.coordinates[3 * n + 2] << "\r\n";
  for (const ElementBlock& block : mesh.blocks) {
    const auto type = std::find_if(kTypes.begin(), kTypes.end(), [&](const Type& t) { return t.shape == block.shape; });
    std::vector<int> order = testing::nodes_between(block.shape, type->order);
    if (block.order == 1) order.resize(std::size_t(reference::info(block.shape).vertices));
    out << "*element, Type=" << (block.order == 1 ? type->linear : type->quadratic) << ", ELSET=Inside\n";
    const std::size_t stride = nodes_per_element(block);
    for (std::size_t e = 0; e < block.size(); ++e) {
      out << block.numbers[e];
      for (std::size_t i = 0; i < order.size(); ++i)
        out << (i % 12 == 11 ? ",\n" : ", ")
            << 10 * (mesh.node_count() - std::size_t(block.nodes[e * stride + std::size_t(order[i])]));
      out << "\n";
    }
  }
  return out.str();
}

TEST(Abaqus, HasTheNodesWhereItsManualHasThem) {
  for (const Filling filling : {Filling::Triangles, Filling::Quadrilaterals, Filling::Tetrahedra, Filling::Hexahedra})
    for (const int order : {1, 2}) {
      const HighOrderMesh mesh = testing::numbered_cells(testing::curved_grid(filling, order));
      const auto file = formats::read(file_of(mesh));
      ASSERT_TRUE(file) << file.error().sentence;
      EXPECT_EQ(file->format, formats::Format::Abaqus);
      EXPECT_EQ(file->mesh.order, order);
      EXPECT_TRUE(check_structure(file->mesh));
      EXPECT_EQ(testing::places_of(file->mesh, mesh.dimension), testing::places_of(mesh, mesh.dimension));
      EXPECT_EQ(file->mesh.physical_groups.at(0).name, "Inside");
    }
}

const std::string kCube =
    "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 1, 1, 0\n4, 0, 1, 0\n5, 0, 0, 1\n6, 1, 0, 1\n7, 1, 1, 1\n8, 0, 1, 1\n"
    "9, 2, 0, 0\n10, 2, 1, 0\n11, 2, 0, 1\n12, 2, 1, 1\n"
    "*ELEMENT, TYPE=C3D8\n1, 1, 2, 3, 4, 5, 6, 7, 8\n2, 2, 9, 10, 3, 6, 11, 12, 7\n";

TEST(Abaqus, SetsAndSurfacesBecomeGroups) {
  const std::string text =
      kCube + "*ELSET, ELSET=both, GENERATE\n1, 2, 1\n*ELSET, ELSET=right\n2.0,\n*ELSET, ELSET=all\nboth\n" +
      "*SURFACE, NAME=Bottom, TYPE=ELEMENT\nboth, S1\n*SURFACE, NAME=Inner\n1, S4\n2, S6\n" +
      "*ELEMENT, TYPE=SPRINGA, ELSET=s\n7, 1, 2\n*STEP\n*STATIC\n1., 1.\n*END STEP\n";
  const HighOrderMesh mesh = testing::read_back(text);
  const auto tagged = [&](const std::string& name, int dimension) {
    std::size_t count = 0;
    for (const PhysicalGroup& group : mesh.physical_groups)
      for (const ElementBlock& block : mesh.blocks)
        if (group.name == name && group.dimension == dimension && reference::info(block.shape).dimension == dimension &&
            std::count(block.physical.begin(), block.physical.end(), group.tag) == 1)
          count += block.size();
    return count;
  };
  EXPECT_EQ(tagged("both", 3), 2U);
  EXPECT_EQ(tagged("all", 3), 2U);
  EXPECT_EQ(tagged("right", 3), 1U);
  EXPECT_EQ(tagged("Bottom", 2), 2U);
  EXPECT_EQ(tagged("Inner", 2), 1U) << "both elements have this side";
  EXPECT_TRUE(check_structure(mesh));
  const auto notes = formats::reading_notes(mesh);
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_EQ(notes[0], "1 element of type SPRINGA was left out, because VariMesh does not read this type.");
}

/// Sets and surfaces may name elements that come after them.
TEST(Abaqus, SetsAndSurfacesMayComeFirst) {
  const std::string groups = "*ELSET, ELSET=Some, GENERATE\n1, 1\n*SURFACE, NAME=Wall\nSome, S1\n1, S3\n";
  const auto first = formats::read("*HEADING\nx\n" + groups + kCube), last = formats::read(kCube + groups);
  ASSERT_TRUE(first && last);
  EXPECT_EQ(first->mesh.blocks.size(), last->mesh.blocks.size());
  std::size_t faces = 0;
  for (const ElementBlock& block : first->mesh.blocks)
    faces += reference::info(block.shape).dimension == 2 ? block.size() : 0;
  EXPECT_EQ(faces, 2U);
  EXPECT_EQ(first->mesh.physical_groups.size(), last->mesh.physical_groups.size());
}

TEST(Abaqus, KeywordsGoOnAfterAComma) {
  std::string text = kCube;
  text.replace(text.find("TYPE=C3D8"), 9, "\r\n** not yet\nTYPE=C3D8, \n  elset=Both");
  const HighOrderMesh mesh = testing::read_back(text);
  EXPECT_EQ(mesh.element_count(3), 2U);
  EXPECT_EQ(mesh.physical_groups.at(0).name, "Both");
  EXPECT_SAYS("*NODE\n1, 0, 0\n*ELEMENT,", "*ELEMENT has no TYPE");
}

TEST(Abaqus, FortransExponentsAreRead) {
  std::string text = kCube;
  text.replace(text.find("2, 1, 0, 0"), 10, "2, 1.0D+0, 0.0d0, -2.5D-1");
  EXPECT_EQ(testing::read_back(text).coordinates.at(3), 1);
  EXPECT_EQ(testing::read_back(text).coordinates.at(5), -.25);
  EXPECT_SAYS(kCube + "*NODE\n20, 1d, 0, 0\n", "a coordinate was expected");
}

/// As Abaqus/CAE writes a model: one part, an instance that does not move it, and a point that loads refer to.
TEST(Abaqus, AnAssemblyMayHaveReferencePoints) {
  const std::string assembly =
      "*ASSEMBLY, NAME=Assembly\n*INSTANCE, NAME=a-1, PART=a\n*END INSTANCE\n*NODE\n1, 5., 5., 5.\n"
      "*NSET, NSET=point\n1,\n*ELEMENT, TYPE=MASS, ELSET=heavy\n1, 1\n*ELSET, ELSET=half, INSTANCE=a-1\n2,\n"
      "*END ASSEMBLY\n*STEP\n*END STEP\n";
  const HighOrderMesh mesh = testing::read_back("*PART, NAME=a\n" + kCube + "*END PART\n" + assembly);
  EXPECT_EQ(mesh.node_count(), 12U);
  EXPECT_EQ(mesh.element_count(3), 2U);
  EXPECT_EQ(mesh.physical_groups.at(0).name, "half");
  // The other way: the part has nothing, and its instance has the mesh.
  const HighOrderMesh other =
      testing::read_back("*PART, NAME=a\n*END PART\n*ASSEMBLY, NAME=b\n*INSTANCE, NAME=a-1, PART=a\n" + kCube +
                         "*END INSTANCE\n*NODE\n1, 5., 5., 5.\n*END ASSEMBLY\n");
  EXPECT_EQ(other.node_count(), 12U);
}

TEST(Abaqus, SerendipityElementsAreCompleted) {
  HighOrderMesh mesh = testing::numbered_cells(testing::curved_grid(Filling::Hexahedra, 2));
  std::string text = file_of(mesh);
  // 20 nodes: the elements end before the middle of the hexahedron.
  std::ostringstream out;
  std::istringstream lines(text.substr(0, text.find("*element")));
  for (std::string line; std::getline(lines, line);) out << line << "\n";
  const std::vector<int> order = testing::nodes_between(Shape::Hexahedron, kTypes[3].order);
  out << "*ELEMENT, TYPE=C3D20R\n";
  for (std::size_t e = 0; e < mesh.blocks[0].size(); ++e) {
    out << e + 1;
    for (std::size_t i = 0; i < 20; ++i)
      out << ", " << 10 * (mesh.node_count() - std::size_t(mesh.blocks[0].nodes[27 * e + std::size_t(order[i])]));
    out << "\n";
  }
  const HighOrderMesh read = testing::read_back(out.str());
  EXPECT_EQ(read.order, 2);
  EXPECT_EQ(nodes_per_element(read.blocks.at(0)), 27U);
  EXPECT_TRUE(check_structure(read));
}

TEST(Abaqus, BadFilesAreRefused) {
  EXPECT_SAYS(kCube + "*NODE\n3, 1, 1, 1\n", "two nodes have the number 3");
  EXPECT_SAYS(kCube + "*ELEMENT, TYPE=C3D8\n1, 1, 2, 3, 4, 5, 6, 7, 8\n", "two elements have the number 1");
  EXPECT_SAYS(kCube + "*ELEMENT, TYPE=C3D4\n3, 1, 2, 3, 77\n",
              "element 3 has the node 77, which the file does not list");
  EXPECT_SAYS(kCube + "*ELEMENT, TYPE=C3D4\n3, 1, 2, 3\n*STEP\n", "element 3 has fewer nodes than its type C3D4 has");
  EXPECT_SAYS(kCube + "*ELEMENT, TYPE=C3D4\n3, 1, 2, 3, 4, 5\n", "element 3 has more nodes");
  EXPECT_SAYS(kCube + "*NODE\n20, 1, 1, nan\n", "node 20 has a coordinate that is not a finite number");
  EXPECT_SAYS(kCube + "*NODE\n20, 1e400, 1, 1\n", "a coordinate is not a finite number");
  EXPECT_SAYS("*HEADING\nx\n*SYSTEM\n10, 0, 0\n" + kCube, "*SYSTEM moves the nodes that follow");
  EXPECT_SAYS(kCube + "*NODE\n20, 1, x\n", "a coordinate was expected before the end of this line");
  EXPECT_SAYS(kCube + "*SURFACE, NAME=a\n1, S9\n*SURFACE, NAME=b\n1, S7\n*NODE\n-1, 0, 0\n", "numbers begin with 1");
  EXPECT_SAYS("*PART, NAME=a\n" + kCube + "*END PART\n*PART, NAME=b\n", "it has several parts");
  EXPECT_SAYS(kCube + "*INSTANCE, NAME=a, PART=b\n1., 0., 0.\n", "an instance moves its part");
  EXPECT_SAYS("*INCLUDE, INPUT=mesh.inp\n", "put its lines into this one");
  EXPECT_SAYS("*HEADING\nx\n*NODE\n1, 0, 0\n", "it has no elements of a plane or a solid");
}

TEST(Abaqus, DamagedFilesAreReadOrRefused) {
  testing::expect_survives_flips(file_of(testing::numbered_cells(testing::curved_grid(Filling::Hexahedra, 2))), 300);
  for (std::size_t k = 0; k < kCube.size(); k += 3) (void)formats::read(kCube.substr(0, k));
}

}  // namespace
}  // namespace varimesh
