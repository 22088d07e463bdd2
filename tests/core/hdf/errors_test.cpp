// Damaged and hostile HDF5 files: every one ends in a sentence.
#include <gtest/gtest.h>

#include "tests/core/hdf/changed.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::curved_grid;
using testing::Filling;

std::string some(Format format) { return test::written(curved_grid(Filling::Hexahedra, 2), format); }

TEST(DamagedHdf5File, IsRefusedWhereverItIsCutShort) {
  NEEDS_HDF5();
  for (const Format format : {Format::Hopr, Format::Cgns}) {
    const std::string whole = some(format);
    ASSERT_EQ(testing::why_not(whole), "it was read");
    for (std::size_t k = 0; k < 50; ++k) {
      const std::string cut = whole.substr(0, k * whole.size() / 50);
      EXPECT_FALSE(formats::read(cut)) << "cut at byte " << cut.size();
      EXPECT_GT(testing::why_not(cut).size(), 20U);
    }
  }
}

TEST(DamagedHdf5File, IsReadOrRefusedWithFlippedBytes) {
  NEEDS_HDF5();
  for (const Format format : {Format::Hopr, Format::Cgns}) testing::expect_survives_flips(some(format), 100);
}

using testing::changed;
using testing::has_h5py;

TEST(HoprErrors, AreSaid) {
  NEEDS_HDF5();
  if (!has_h5py()) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  const std::string whole = some(Format::Hopr);
  const auto says = [&](const std::string& code, const std::string& words) {
    SCOPED_TRACE(code);
    EXPECT_SAYS(changed(whole, code), words);
  };
  says("f[\"GlobalNodeIDs\"][3] = 100000", "has the number 100000, but nodes are numbered 1 to");
  says("f[\"GlobalNodeIDs\"][3] = 0", "has the number 0");
  says("f[\"ElemInfo\"][0, 0] = 207", "has the element type 207, which HOPR does not know (row 1, counted from 1)");
  says("f[\"ElemInfo\"][1, 5] += 1", "too few rows of nodes");
  says("f[\"ElemInfo\"][0, 3] += 1", "hanging nodes");
  says("f[\"ElemInfo\"][1, 1] = -4", "the zone -4");
  says("f[\"NodeCoords\"][2, 0] += 1", "has a node at another place");
  says("f[\"SideInfo\"][0, 2] = 99", "names the neighbour 99, but the elements are 1 to 2");
  says("f[\"SideInfo\"][0, 2] = -1", "hanging nodes");
  says("f[\"SideInfo\"][0, 4] = 9", "names the boundary condition 9, but they are 1 to 6");
  says("f[\"SideInfo\"][:, 4] = 0", "neither a neighbour nor a boundary condition");
  says("f.attrs[\"Ngeo\"] = 11", "is 11; VariMesh takes orders from 1 to 10");
  says("f.attrs[\"Ngeo\"] = 3", "too few rows of nodes");
  says("del f[\"NodeCoords\"]", "'/NodeCoords' is missing");
  says("del f[\"BCType\"]; f[\"BCType\"] = np.zeros((2, 4), \"i4\")", "not four for each of the 6 names");
  says("x = f[\"NodeCoords\"][:-1]; del f[\"NodeCoords\"]; f[\"NodeCoords\"] = x", "rows, but the elements have 54");
  says("del f[\"GlobalNodeIDs\"]; f[\"GlobalNodeIDs\"] = np.zeros(54)", "is not an array of integers");
  says("del f[\"SideInfo\"]; f[\"SideInfo\"] = np.zeros((12, 3), \"i4\")", "has fewer than 5 values in a row");
}

TEST(CgnsErrors, AreSaid) {
  NEEDS_HDF5();
  if (!has_h5py()) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  const std::string whole = some(Format::Cgns);
  const auto says = [&](const std::string& code, const std::string& words) {
    SCOPED_TRACE(code);
    EXPECT_SAYS(changed(whole, code), words);
  };
  const std::string zone = "z = f[\"Base/Zone\"]; s = [n for n in z if n.startswith(\"Hexa\")][0]; ";
  says(zone + "z[s][\"ElementConnectivity/ data\"][5] = 1000", "refers to node 1000, but the nodes are 1 to 45");
  says(zone + "z[s][\"ElementConnectivity/ data\"][5] = 0", "refers to node 0");
  says(zone + "z[s][\" data\"][0] = 38", "elements of type 38, which VariMesh does not know");
  says(zone + "z[s][\" data\"][0] = 22", "polygons or polyhedra");
  says(zone + "z[s][\" data\"][0] = 17", "has more than the elements of its section");
  says(zone + "z[s][\"ElementRange/ data\"][1] += 1", "");
  says("f[\"Base/Zone/ data\"][0, 0] = 44", "has 45 numbers, but the zone has 44 nodes");
  says("f[\"Base/ data\"][0] = 4", "does not give dimensions 2 or 3");
  says("f[\"Base/Zone/ZoneType/ data\"][0] = 66", "is not Unstructured");
  says("del f[\"Base/Zone/GridCoordinates\"]", "'/Base/Zone/GridCoordinates' is missing");
  says("f[\"Base/Zone/ZoneBC/left/PointRange/ data\"][1, 0] = 500", "has the number 500, but they go from 1 to");
  EXPECT_SAYS("@(#)ADF Database Version", "adf2hdf");
}

// Programs list the nodes of a boundary condition, or elements of several shapes in one section.
TEST(CgnsFile, OfOtherProgramsIsReadAlike) {
  NEEDS_HDF5();
  if (!has_h5py()) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  const std::string whole = some(Format::Cgns);
  const HighOrderMesh mesh = testing::read_back(whole);
  const std::string sections =
      "z = f[\"Base/Zone\"]; text = lambda s: np.frombuffer(s.encode(), \"i1\"); "
      "all = [(n, z[n + \"/ElementRange/ data\"][0], z[n + \"/ElementConnectivity/ data\"][:]) for n in z if "
      "n + \"/ElementRange\" in z]; each = {True: 27, False: 9}; "
      "elements = {f + k: c.reshape(-1, each[\"Hexa\" in n])[k] for n, f, c in all for k in range(len(c) // "
      "each[\"Hexa\" in n])}; "
      "put = lambda g, v: (g.pop(\" data\"), g.create_dataset(\" data\", data=v)); ";
  const std::string by_nodes =
      "[(put(b[\"PointRange\"], np.unique(np.concatenate([elements[e] for e in range(b[\"PointRange/ data\"][0, 0], "
      "b[\"PointRange/ data\"][1, 0] + 1)]))[:, None]), b.move(\"PointRange\", \"PointList\"), "
      "put(b[\"GridLocation\"], text(\"Vertex\"))) for b in [z[\"ZoneBC\"][n] for n in z[\"ZoneBC\"]]]";
  const std::string mixed =
      "[(put(z[n + \"/ElementConnectivity\"], np.concatenate([np.r_[z[n + \"/ data\"][0], e] for e in c.reshape(-1, "
      "each[\"Hexa\" in n])])), z[n + \"/ data\"].write_direct(np.array([20, 0], \"i4\"))) for n, f, c in all]";
  for (const std::string& code : {by_nodes, mixed}) {
    SCOPED_TRACE(code);
    const HighOrderMesh back = testing::read_back(changed(whole, sections + code));
    ASSERT_EQ(back.blocks.size(), mesh.blocks.size());
    for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
      EXPECT_EQ(back.blocks[b].nodes, mesh.blocks[b].nodes);
      EXPECT_EQ(back.blocks[b].numbers, mesh.blocks[b].numbers);
      EXPECT_EQ(back.blocks[b].physical, mesh.blocks[b].physical);
    }
  }
}

TEST(Hdf5Errors, NameOtherFiles) {
  NEEDS_HDF5();
  EXPECT_SAYS(some(Format::Pyfr), "a mesh or a solution of PyFR, which VariMesh only writes");
  EXPECT_SAYS(std::string("\x89HDF\r\n\x1a\n", 8), "is not a whole HDF5 file");
}

// A file must not make the service read another file of its machine.
TEST(Hdf5Errors, LinksToOtherFilesAreNotFollowed) {
  NEEDS_HDF5();
  if (!has_h5py()) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  const test::Folder folder;
  const std::string whole = some(Format::Hopr), other = folder.file("other.h5");
  std::ofstream(other, std::ios::binary) << whole;
  const std::string by_link =
      "del f[\"NodeCoords\"]; f[\"NodeCoords\"] = h5py.ExternalLink(\"" + other + "\", \"/NodeCoords\")";
  EXPECT_SAYS(changed(whole, by_link), "leads to another file");
  const std::string outside = "del f[\"NodeCoords\"]; f.create_dataset(\"NodeCoords\", (54, 3), \"f8\", external=[(\"" +
                              other + "\", 0, h5py.h5f.UNLIMITED)])";
  EXPECT_SAYS(changed(whole, outside), "leads to another file");
}

TEST(Hdf5Errors, AMissingProgramIsSaid) {
  NEEDS_HDF5();
  const std::string whole = some(Format::Hopr);
  const std::string program = std::getenv("VARIMESH_HDF5");
  ::setenv("VARIMESH_HDF5", "/nowhere", 1);
  EXPECT_SAYS(whole, "VariMesh was installed without HDF5: varimesh_hdf5");
  EXPECT_NE(some(Format::Hopr).find("HDF5 files cannot be written: VariMesh was installed without HDF5"),
            std::string::npos);
  EXPECT_FALSE(formats::has_hdf5());
  ::setenv("VARIMESH_HDF5", program.c_str(), 1);
}

}  // namespace
}  // namespace varimesh
