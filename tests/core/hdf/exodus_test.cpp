// Exodus files in HDF5, made with h5py as the format's description has them: elements, blocks, side sets, bad files.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "core/mesh/check.h"
#include "tests/core/hdf/changed.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/listed_elements.h"

namespace varimesh {
namespace {

using testing::changed;
using testing::Filling;

#define NEEDS_H5PY() \
  NEEDS_HDF5();      \
  if (!testing::has_h5py()) GTEST_SKIP() << "SKIPPED: h5py is not installed (python3-h5py)"

struct Type {
  Shape shape;
  std::string name, order;
};

/// The nodes as the description of the format lists them.
const std::vector<Type> kTypes = {
    {Shape::Triangle, "TRI6", "0 1 2 01 12 20"},
    {Shape::Quadrilateral, "QUAD9", "0 1 2 3 01 12 23 30 0123"},
    {Shape::Tetrahedron, "TETRA10", "0 1 2 3 01 12 20 03 13 23"},
    {Shape::Prism, "WEDGE18", "0 1 2 3 4 5 01 12 20 03 14 25 34 45 53 0134 1245 0235"},
    {Shape::Hexahedron, "HEX27",
     "0 1 2 3 4 5 6 7 01 12 23 30 04 15 26 37 45 56 67 74 01234567 0123 4567 0347 1256 0145 2367"}};

/// An HDF5 file without anything, as h5py makes it.
std::string empty_file() {
  const test::Folder folder;
  const std::string file = folder.file("empty.h5");
  EXPECT_EQ(std::system(("/usr/bin/python3 -c 'import h5py; h5py.File(\"" + file + "\", \"w\").close()'").c_str()), 0);
  return test::slurp(file);
}

std::string list(const std::vector<double>& values) {
  std::ostringstream out;
  out.precision(17);
  out << "[";
  for (const double value : values) out << value << ",";
  out << "]";
  return out.str();
}

/// Python code that writes the cells of a mesh of order 2, as one block with the id 40 and the name "fluid".
std::string code_of(const HighOrderMesh& mesh) {
  std::string code;
  for (std::size_t k = 0; k < 3; ++k) {
    std::vector<double> x;
    for (std::size_t n = 0; n < mesh.node_count(); ++n) x.push_back(mesh.coordinates[3 * n + k]);
    code += std::string("f[\"coord") + "xyz"[k] + "\"] = np.array(" + list(x) + "); ";
  }
  const ElementBlock& block = mesh.blocks[0];
  const auto type = std::find_if(kTypes.begin(), kTypes.end(), [&](const Type& t) { return t.shape == block.shape; });
  std::vector<double> nodes;
  const std::size_t stride = nodes_per_element(block);
  for (std::size_t e = 0; e < block.size(); ++e)
    for (const int local : testing::nodes_between(block.shape, type->order))
      nodes.push_back(block.nodes[e * stride + std::size_t(local)] + 1);
  code +=
      "f[\"connect1\"] = np.array(" + list(nodes) + ").astype(\"i4\").reshape(-1, " + std::to_string(stride) + "); ";
  return code + "f[\"connect1\"].attrs[\"elem_type\"] = np.bytes_(\"" + type->name +
         "\"); f[\"eb_prop1\"] = np.array([40]); f[\"eb_names\"] = np.array([[c.encode() for c in \"fluid\"]], \"S1\")";
}

TEST(Exodus, HasTheNodesWhereItsDescriptionHasThem) {
  NEEDS_H5PY();
  for (const Filling filling :
       {Filling::Triangles, Filling::Quadrilaterals, Filling::Tetrahedra, Filling::Prisms, Filling::Hexahedra}) {
    const HighOrderMesh mesh = testing::numbered_cells(testing::curved_grid(filling, 2));
    const HighOrderMesh read = testing::read_back(changed(empty_file(), code_of(mesh)));
    EXPECT_TRUE(check_structure(read));
    EXPECT_EQ(testing::places_of(read, mesh.dimension), testing::places_of(mesh, mesh.dimension));
    ASSERT_EQ(read.physical_groups.size(), 1U);
    EXPECT_EQ(read.physical_groups[0].tag, 40);
    EXPECT_EQ(read.physical_groups[0].name, "fluid");
  }
}

TEST(Exodus, SideSetsBecomeBoundaryElements) {
  NEEDS_H5PY();
  const HighOrderMesh mesh = testing::numbered_cells(testing::grid(Filling::Hexahedra, {1, 1, 1}, 2));
  const std::string sets =
      "; f[\"ss_prop1\"] = np.array([7, 9]); f[\"elem_ss1\"] = np.array([1]); f[\"side_ss1\"] = np.array([5]); "
      "f[\"elem_ss2\"] = np.array([1, 1]); f[\"side_ss2\"] = np.array([2, 6])";
  const HighOrderMesh read = testing::read_back(changed(empty_file(), code_of(mesh) + sets));
  ASSERT_EQ(read.element_count(2), 3U);
  EXPECT_TRUE(check_structure(read));
  const auto z = [&](int tag) {
    std::vector<double> all;
    for (const ElementBlock& block : read.blocks)
      if (block.physical == std::vector<int>{tag})
        for (std::size_t i = 0; i < block.nodes.size(); ++i)
          all.push_back(read.coordinates[3 * std::size_t(block.nodes[i]) + 2]);
    return all;
  };
  EXPECT_EQ(z(7), std::vector<double>(9, 0.0)) << "side 5 is the bottom";
  EXPECT_EQ(z(9).size(), 18U);
}

/// The groups by dimension and name, with the number of their elements.
std::map<std::pair<int, std::string>, std::size_t> groups_of(const HighOrderMesh& mesh) {
  std::map<std::pair<int, std::string>, std::size_t> groups;
  for (const PhysicalGroup& group : mesh.physical_groups)
    for (const ElementBlock& block : mesh.blocks)
      if (reference::info(block.shape).dimension == group.dimension &&
          std::count(block.physical.begin(), block.physical.end(), group.tag) == 1)
        groups[{group.dimension, group.name}] += block.size();
  return groups;
}

using Groups = std::map<std::pair<int, std::string>, std::size_t>;

TEST(Exodus, ABlockWithoutElementsHidesNoOthers) {
  NEEDS_H5PY();
  const HighOrderMesh mesh = testing::numbered_cells(testing::grid(Filling::Hexahedra, {1, 1, 1}, 2));
  const std::string second =
      "; f[\"connect2\"] = f[\"connect1\"][:]; f[\"connect2\"].attrs[\"elem_type\"] = np.bytes_(\"HEX27\"); "
      "del f[\"connect1\"], f[\"eb_prop1\"], f[\"eb_names\"]; f[\"eb_prop1\"] = np.array([40, 50])";
  const HighOrderMesh read = testing::read_back(changed(empty_file(), code_of(mesh) + second));
  EXPECT_EQ(groups_of(read), (Groups{{{3, "block_50"}, 1}}));
}

/// Sides 1 and 2 of a shell are the shell, seen from either side, and its edges come after them.
TEST(Exodus, TrianglesInSpaceAreShells) {
  NEEDS_H5PY();
  const HighOrderMesh mesh = testing::numbered_cells(testing::grid(Filling::Triangles, {1, 1, 1}, 2));
  const std::string sets =
      "; f[\"ss_prop1\"] = np.array([40]); f[\"elem_ss1\"] = np.array([1, 2, 2]); f[\"side_ss1\"] = np.array([2, 3, "
      "5])";
  for (const char* type : {"TRI6", "TRISHELL6", "TRIANGLE"}) {
    const std::string named = std::string("; f[\"connect1\"].attrs[\"elem_type\"] = np.bytes_(\"") + type + "\")";
    const HighOrderMesh read = testing::read_back(changed(empty_file(), code_of(mesh) + named + sets));
    EXPECT_EQ(groups_of(read), (Groups{{{2, "fluid"}, 2}, {{2, "side_set_40"}, 1}, {{1, "side_set_40"}, 2}})) << type;
  }
  const std::string flat =
      "; del f[\"coordz\"]; f[\"ss_prop1\"] = np.array([40]); f[\"elem_ss1\"] = np.array([1, 2]); "
      "f[\"side_ss1\"] = np.array([2, 3])";
  EXPECT_EQ(groups_of(testing::read_back(changed(empty_file(), code_of(mesh) + flat))),
            (Groups{{{2, "fluid"}, 2}, {{1, "side_set_40"}, 2}}));
}

TEST(Exodus, BadFilesAreRefused) {
  NEEDS_H5PY();
  const std::string whole =
      changed(empty_file(), code_of(testing::numbered_cells(testing::grid(Filling::Hexahedra, {1, 1, 1}, 2))));
  EXPECT_SAYS(changed(whole, "f[\"connect1\"][0, 3] = 99"), "has the node 99, but nodes are 1 to 27");
  EXPECT_SAYS(changed(whole,
                      "f[\"connect1\"].attrs[\"elem_type\"] = np.bytes_(\"HEX9\"); del f[\"coordz\"]; "
                      "f[\"coordz\"] = np.zeros(5)"),
              "has another length than coordx");
  EXPECT_SAYS(changed(whole, "f[\"connect1\"].attrs[\"elem_type\"] = np.bytes_(\"TETRA14\")"),
              "has elements of type 'TETRA14' with 27 nodes");
  EXPECT_SAYS(changed(whole, "f[\"coordx\"][2] = np.nan"), "is not a finite number");
  EXPECT_SAYS(changed(whole, "del f[\"connect1\"].attrs[\"elem_type\"]"), "is a missing attribute");
  EXPECT_SAYS(changed(whole,
                      "f[\"ss_prop1\"] = np.array([1]); f[\"elem_ss1\"] = np.array([4]); "
                      "f[\"side_ss1\"] = np.array([1])"),
              "has the element 4, but elements are 1 to 1");
  EXPECT_SAYS(changed(whole,
                      "f[\"ss_prop1\"] = np.array([1]); f[\"elem_ss1\"] = np.array([1]); "
                      "f[\"side_ss1\"] = np.array([7])"),
              "has the side 7 of an element that has 6");
}

}  // namespace
}  // namespace varimesh
