// PyFR's meshes; peers_test.cpp reads what is written.

#include <gtest/gtest.h>

#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::curved_grid;
using testing::Filling;

TEST(Pyfr, WritesEveryShapeAndOrder) {
  NEEDS_HDF5();
  for (const Filling filling : {Filling::Quadrilaterals, Filling::Triangles, Filling::MixedPlane, Filling::Hexahedra,
                                Filling::Prisms, Filling::Tetrahedra})
    for (const int order : {1, 2, 5, 10}) {
      const HighOrderMesh mesh = curved_grid(filling, order);
      const std::string bytes = test::written(mesh, Format::Pyfr);
      EXPECT_EQ(bytes.find("not written"), std::string::npos) << bytes.substr(0, 200);
      EXPECT_EQ(test::written(mesh, Format::Pyfr), bytes) << "the bytes of a file depend on its mesh only";
    }
}

TEST(Pyfr, TakesPyramidsOnlyOnParallelograms) {
  NEEDS_HDF5();
  const std::string straight = test::written(testing::grid(Filling::Pyramids, {2, 1, 1}, 3), Format::Pyfr);
  EXPECT_EQ(straight.find("not written"), std::string::npos);
  EXPECT_NE(test::written(testing::grid(Filling::Pyramids, {2, 1, 1}, 3, testing::bent(3)), Format::Pyfr)
                .find("a pyramid whose base is no parallelogram, which PyFR does not take"),
            std::string::npos);
}

TEST(Pyfr, RefusesSurfacesInSpace) {
  NEEDS_HDF5();
  HighOrderMesh mesh = curved_grid(Filling::Triangles, 2);
  mesh.coordinates[2] = 1;
  EXPECT_NE(test::written(mesh, Format::Pyfr).find("a plane z = constant and of solids only"), std::string::npos);
}

TEST(Pyfr, PairsPeriodicSidesThatShareAGroup) {
  NEEDS_HDF5();
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {2, 1, 1}, 1);
  for (ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == 1) block.physical = {1};
  mesh.physical_groups = {{1, 1, "all"}};
  EXPECT_EQ(test::written(mesh, Format::Pyfr).find("periodic"), std::string::npos);
  PeriodicLink link{1, 1, 1, {}, {}};
  for (std::int32_t a = 0; a < std::int32_t(mesh.node_count()); ++a)
    for (std::int32_t b = 0; b < std::int32_t(mesh.node_count()); ++b)
      if (mesh.coordinates[3 * std::size_t(a)] == 0 && mesh.coordinates[3 * std::size_t(b)] == 1 &&
          mesh.coordinates[3 * std::size_t(a) + 1] == mesh.coordinates[3 * std::size_t(b) + 1])
        link.nodes.emplace_back(a, b);
  ASSERT_EQ(link.nodes.size(), 2U);
  mesh.periodic.push_back(link);
  EXPECT_NE(test::written(mesh, Format::Pyfr).find("periodic"), std::string::npos);
}

TEST(Pyfr, NamesThatBecomeAlikeStayApart) {
  NEEDS_HDF5();
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {1, 1, 1}, 1);
  mesh.physical_groups[0].name = "in/out";
  mesh.physical_groups[1].name = "in_out";
  const std::string bytes = test::written(mesh, Format::Pyfr);
  const std::size_t first = bytes.find("bc/in_out");
  ASSERT_NE(first, std::string::npos);
  EXPECT_NE(bytes.find("bc/in_out_2", first), std::string::npos);
}

TEST(Pyfr, SaysWhatItLeavesOut) {
  HighOrderMesh mesh = curved_grid(Filling::Tetrahedra, 2);
  for (ElementBlock& block : mesh.blocks) block.physical = {3, 4};
  EXPECT_EQ(formats::left_out(mesh, Format::Pyfr),
            "PyFR's format has no place for groups of cells and the second group of boundary elements; the file leaves "
            "them out.");
}

}  // namespace
}  // namespace varimesh
