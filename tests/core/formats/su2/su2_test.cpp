// What is written for SU2: vertices, straight cells and markers. Debian's meshio reads it.
#include "core/formats/su2/su2.h"

#include <gtest/gtest.h>

#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::Filling;

TEST(Su2, WritesAPlane) {
  const HighOrderMesh mesh = testing::grid(Filling::MixedPlane, {2, 1, 1}, 1);
  const std::string bytes = test::written(mesh, Format::Su2);
  EXPECT_TRUE(bytes.starts_with("NDIME= 2\nNELEM= 3\n9 0 1 4 3\n5 1 2 5\n5 1 5 4\nNPOIN= 6\n0 0\n0.5 0\n1 0\n"))
      << bytes;
  EXPECT_NE(bytes.find("NMARK= 4\nMARKER_TAG= left\nMARKER_ELEMS= 1\n3 "), std::string::npos) << bytes;
  EXPECT_EQ(formats::left_out(mesh, Format::Su2), "");
}

TEST(Su2, HasTheVerticesOfCurvedCellsOnlyAndSaysSo) {
  const HighOrderMesh curved = testing::grid(Filling::MixedSolid, {4, 1, 1}, 3, testing::bent(3));
  HighOrderMesh straight = testing::grid(Filling::MixedSolid, {4, 1, 1}, 1, testing::bent(3));
  EXPECT_EQ(test::written(curved, Format::Su2), test::written(straight, Format::Su2));
  EXPECT_EQ(formats::left_out(curved, Format::Su2),
            "SU2's format has no place for curved sides (SU2's elements are straight between their vertices); the file "
            "leaves them out.");
  straight.blocks[0].physical = {7};
  straight.periodic.push_back({});
  straight.blocks[0].partitions = {1};
  EXPECT_EQ(formats::left_out(straight, Format::Su2),
            "SU2's format has no place for groups of cells, periodic links and partitions; the file leaves them out.");
}

TEST(Su2, MarkersHaveNoBlanks) {
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {1, 1, 1}, 1);
  mesh.physical_groups[0].name = "the left, side";
  EXPECT_NE(test::written(mesh, Format::Su2).find("MARKER_TAG= the_left__side\n"), std::string::npos);
}

TEST(Su2, NamesThatBecomeAlikeStayApart) {
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {1, 1, 1}, 1);
  mesh.physical_groups[0].name = "a b";
  mesh.physical_groups[1].name = "a_b";
  const std::string bytes = test::written(mesh, Format::Su2);
  EXPECT_NE(bytes.find("MARKER_TAG= a_b\n"), std::string::npos);
  EXPECT_NE(bytes.find("MARKER_TAG= a_b_2\n"), std::string::npos);
}

TEST(Su2, LeavesOutBoundaryElementsWithVerticesOfNoCell) {
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {1, 1, 1}, 1);
  const std::string without = test::written(mesh, Format::Su2);
  const auto last = std::int32_t(mesh.node_count());
  for (const double x : {7.0, 8.0}) {
    mesh.coordinates.insert(mesh.coordinates.end(), {x, 0, 0});
    mesh.node_numbers.push_back(std::int64_t(mesh.node_count()));
  }
  mesh.blocks.push_back({Shape::Line, 1, 9, {1}, {100, 101}, {0, last, last, last + 1}, {}, {}});
  mesh.blocks.push_back({Shape::Line, 1, 9, {9}, {102}, {last, last + 1}, {}, {}});
  EXPECT_EQ(test::written(mesh, Format::Su2), without) << "a marker without elements is left out too";
  EXPECT_EQ(formats::left_out(mesh, Format::Su2),
            "SU2's format has no place for 3 boundary elements with vertices that belong to no cell; the file leaves "
            "them out.");
}

TEST(Su2, SurfacesInSpaceAreRefused) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {1, 1, 1}, 1);
  mesh.coordinates[2] = 1;
  EXPECT_NE(test::written(mesh, Format::Su2).find("not written"), std::string::npos);
}

TEST(Su2, IsReadByMeshio) {
  if (std::system("/usr/bin/python3 -c 'import meshio' >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "SKIPPED: meshio is not installed (python3-meshio)";
  const test::Folder folder;
  const HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {3, 2, 1}, 2);
  ASSERT_TRUE(formats::write_file(mesh, Format::Su2, folder.file("a.su2")));
  const std::string script =
      "import meshio; mesh = meshio.read('" + folder.file("a.su2") +
      "'); assert len(mesh.points) == 24; assert sum(len(b.data) for b in mesh.cells if b.type == 'hexahedron') == 6; "
      "assert sum(len(b.data) for b in mesh.cells if b.type == 'quad') == 22";
  EXPECT_EQ(std::system(("/usr/bin/python3 -c \"" + script + "\"").c_str()), 0);
}

}  // namespace
}  // namespace varimesh
