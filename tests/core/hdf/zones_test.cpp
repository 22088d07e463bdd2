// CGNS files with several zones: zones that a connectivity joins become one mesh.
#include <gtest/gtest.h>

#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "tests/core/hdf/changed.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::changed;
using testing::Filling;
using testing::read_back;

HighOrderMesh box(Filling filling, int order) { return testing::grid(filling, {2, 2, 2}, order); }

/// Adds a node of the tree. Lines of Python.
const std::string kNode = R"(
def node(path, label, values=None):
    g = f.create_group(path)
    g.attrs["name"] = np.bytes_(path.split("/")[-1]); g.attrs["label"] = np.bytes_(label)
    g.attrs["type"] = np.bytes_("C1" if isinstance(values, str) else "MT" if values is None else "I4")
    if isinstance(values, str): values = np.frombuffer(values.encode(), "i1")
    if values is not None: g[" data"] = np.array(values)
    return g
)";

/// Copies the zone and moves the copy to the right, so that it begins where the zone ends. The connectivity is that of
/// nodes; `type`: how it joins; `also`: Python code before the end.
std::string two_zones(const std::string& one, const std::string& type = "Abutting1to1", const std::string& also = "") {
  return changed(one, kNode + R"(
f.copy("Base/Zone", "Base/Other")
f["Base/Other"].attrs["name"] = np.bytes_("Other")
x = f["Base/Other/GridCoordinates/CoordinateX/ data"]
x[...] += x[...].max() - x[...].min()
def places(zone, x):
    c = [f["Base/" + zone + "/GridCoordinates/Coordinate" + k + "/ data"][...] for k in "XYZ" if "Coordinate" + k in f["Base/Zone/GridCoordinates"]]
    at = np.flatnonzero(abs(c[0] - x) < 1e-9)
    return at[np.lexsort([np.round(k[at], 9) for k in c[1:]])] + 1
own = places("Zone", x[...].min()); its = places("Other", x[...].min())
assert len(own) == len(its) > 0
node("Base/Zone/ZoneGridConnectivity", "ZoneGridConnectivity_t")
p = "Base/Zone/ZoneGridConnectivity/Joint"
node(p, "GridConnectivity_t", "Other")
node(p + "/GridConnectivityType", "GridConnectivityType_t", ")" +
                          type + R"(")
node(p + "/PointList", "IndexArray_t", own.reshape(-1, 1).astype("i4"))
node(p + "/PointListDonor", "IndexArray_t", its.reshape(-1, 1).astype("i4"))
)" + also + "\npass");
}

class CgnsZones : public ::testing::TestWithParam<Filling> {};

TEST_P(CgnsZones, AreJoinedToOneMesh) {
  NEEDS_HDF5();
  if (!testing::has_h5py()) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  for (int order = 1; order <= 4; ++order) {
    const HighOrderMesh one = box(GetParam(), order);
    const HighOrderMesh mesh = read_back(two_zones(test::written(one, Format::Cgns)));
    const auto sound = check_structure(mesh);
    ASSERT_TRUE(sound) << sound.error().sentence;
    EXPECT_EQ(mesh.element_count(mesh.dimension), 2 * one.element_count(one.dimension));
    // The whole has as many nodes as the same grid of twice the length, and every facet between the halves is inside.
    const HighOrderMesh whole = testing::grid(GetParam(), {4, 2, 2}, order);
    EXPECT_EQ(mesh.node_count(), whole.node_count());
    const auto outside = [](const HighOrderMesh& m) {
      const Facets all = facets(m);
      return std::count(all.neighbour.begin(), all.neighbour.end(), -1);
    };
    EXPECT_EQ(outside(mesh), outside(whole));
    // Both zones have the groups of sides, and a group of cells each.
    EXPECT_EQ(mesh.physical_groups.size(), one.physical_groups.size() + 2);
    EXPECT_EQ(mesh.physical_groups.back().dimension, mesh.dimension);
    EXPECT_NE(formats::left_out(mesh, Format::Cgns).find("the division into zones"), std::string::npos);
    const HighOrderMesh back = read_back(test::written(mesh, Format::Cgns));
    EXPECT_EQ(back.coordinates, mesh.coordinates);
    EXPECT_EQ(back.physical_groups.size(), mesh.physical_groups.size());
  }
}

// Moved to the right, a mixed solid does not fit itself.
INSTANTIATE_TEST_SUITE_P(EveryShape, CgnsZones,
                         ::testing::Values(Filling::Quadrilaterals, Filling::Triangles, Filling::MixedPlane,
                                           Filling::Hexahedra, Filling::Prisms, Filling::Pyramids, Filling::Tetrahedra),
                         [](const auto& info) { return std::string(testing::name(info.param)); });

TEST(CgnsZonesErrors, AreSaid) {
  NEEDS_HDF5();
  if (!testing::has_h5py()) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  const std::string one = test::written(box(Filling::Hexahedra, 2), Format::Cgns);
  const auto says = [&](const std::string& also, const std::string& words) {
    EXPECT_SAYS(two_zones(one, "Abutting1to1", also), words);
  };
  says("", "it was read");
  EXPECT_SAYS(two_zones(one, "Overset"), "joins zones by Overset; VariMesh joins zones whose nodes coincide");
  says("f[p + \"/PointList/ data\"][3, 0] = 0", "has the number 0, but they go from 1 to");
  says("f[p + \"/PointListDonor/ data\"][3, 0] = 1000", "has the number 1000");
  says("f[p + \"/PointList/ data\"][3, 0] += 1", "pairs nodes at different places");
  says("del f[p + \"/ data\"]; f[p + \"/ data\"] = np.frombuffer(b\"None\", \"i1\")",
       "the zone \'None\', which is not there");
  says("del f[p + \"/PointList\"]; node(p + \"/PointList\", \"IndexArray_t\", own[:3])", "pairs 3 points with 25");
  // Periodic boundaries join nothing.
  const HighOrderMesh apart = read_back(two_zones(
      one, "Abutting1to1",
      "node(p + \"/Property\", \"GridConnectivityProperty_t\"); node(p + \"/Property/Periodic\", \"Periodic_t\")"));
  EXPECT_EQ(apart.node_count(), 2 * box(Filling::Hexahedra, 2).node_count());
}

TEST(CgnsZonesByHand, ZonesWithoutAConnectivityStayApart) {
  NEEDS_HDF5();
  if (!testing::has_h5py()) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  const HighOrderMesh one = box(Filling::Hexahedra, 2);
  const std::string bytes = two_zones(test::written(one, Format::Cgns), "Overset", "del f[p]");
  EXPECT_EQ(read_back(bytes).node_count(), 2 * one.node_count());
}

TEST(CgnsZonesByHand, AreJoinedByPairsOfSides) {
  NEEDS_HDF5();
  if (!testing::has_h5py()) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)";
  // The sides of the groups "right" and "left" face each other, in the order of the grid.
  const std::string code = R"(
sides = lambda zone, name: f["Base/" + zone + "/ZoneBC/" + name]
def numbers(bc):
    if "PointList" in bc: return bc["PointList/ data"][...].reshape(-1)
    a, b = bc["PointRange/ data"][...].reshape(-1)
    return np.arange(a, b + 1)
right, left = numbers(sides("Zone", "right")), numbers(sides("Other", "left"))
for list, values in (("PointList", right), ("PointListDonor", left)):
    del f[p + "/" + list]
    node(p + "/" + list, "IndexArray_t", values.reshape(-1, 1).astype("i4"))
node(p + "/GridLocation", "GridLocation_t", "FaceCenter")
del f["Base/Zone/ZoneBC/right"]; del f["Base/Other/ZoneBC/left"])";
  const HighOrderMesh one = box(Filling::Hexahedra, 3);
  const std::string bytes = two_zones(test::written(one, Format::Cgns), "Abutting1to1", code);
  const HighOrderMesh mesh = read_back(bytes);
  EXPECT_EQ(mesh.node_count(), testing::grid(Filling::Hexahedra, {4, 2, 2}, 3).node_count());
  // The sides between the zones were there for the connectivity only.
  EXPECT_EQ(mesh.element_count(2), 2 * one.element_count(2) - 8);
}

}  // namespace
}  // namespace varimesh
