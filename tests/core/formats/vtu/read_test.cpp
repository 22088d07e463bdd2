// VTK's unstructured grids are read: every shape and order, every encoding, and what VTK and meshio write.
#include "core/formats/vtu/read.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/formats/vtu/boundary.h"
#include "core/formats/vtu/cells.h"
#include "core/formats/vtu/write.h"
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

/// Expects the same elements of these dimensions in the same order, with the same nodes, groups and numbers.
void expect_same_elements(const HighOrderMesh& a, const HighOrderMesh& b, const std::string& where,
                          double tolerance = 0) {
  ASSERT_EQ(a.dimension, b.dimension) << where;
  EXPECT_EQ(a.order, b.order) << where;
  for (const int d : {a.dimension, a.dimension - 1}) {
    const Cells from(a, d), to(b, d);
    ASSERT_EQ(from.count(), to.count()) << where;
    for (std::size_t e = 0; e < from.count(); ++e) {
      ASSERT_EQ(from.shape(e), to.shape(e)) << where;
      EXPECT_EQ(from.number(e), to.number(e)) << where;
      const auto own = from.nodes(e), other = to.nodes(e);
      ASSERT_EQ(own.size(), other.size()) << where;
      for (std::size_t i = 0; i < own.size(); ++i)
        for (std::size_t k = 0; k < 3; ++k)
          ASSERT_NEAR(a.coordinates[3 * std::size_t(own[i]) + k], b.coordinates[3 * std::size_t(other[i]) + k],
                      tolerance)
              << where << ", node " << i << " of " << reference::info(from.shape(e)).name;
      EXPECT_EQ(from.range_of(e).block->physical, to.range_of(e).block->physical) << where;
    }
  }
}

class VtuShapes : public ::testing::TestWithParam<Filling> {};

constexpr int kMostOrder = 5;

TEST_P(VtuShapes, ComeBackBitForBit) {
  for (int order = 1; order <= kMostOrder; ++order) {
    const HighOrderMesh mesh = curved_grid(GetParam(), order);
    const std::string bytes = test::written(mesh, Format::Vtu);
    const HighOrderMesh back = read_back(bytes);
    expect_same_elements(mesh, back, "order " + std::to_string(order));
    EXPECT_EQ(back.node_count(), mesh.node_count()) << "no points of pyramids are left";
    EXPECT_EQ(back.physical_groups.size(), mesh.physical_groups.size());
    EXPECT_EQ(test::written(back, Format::Vtu), bytes);
    const auto sound = check_structure(back);
    EXPECT_TRUE(sound) << sound.error().sentence;
  }
}

TEST_P(VtuShapes, ChainWithGmshsFormats) {
  for (int order = 1; order <= kMostOrder; ++order) {
    const HighOrderMesh mesh = curved_grid(GetParam(), order);
    for (const Format other : {Format::Msh22, Format::Msh41Binary}) {
      const HighOrderMesh back = read_back(test::written(read_back(test::written(mesh, other)), Format::Vtu));
      expect_same_elements(mesh, back, "order " + std::to_string(order));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(EveryShape, VtuShapes, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return std::string(testing::name(info.param)); });

const Shape kCells[] = {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron,
                        Shape::Pyramid,  Shape::Prism,         Shape::Hexahedron};

TEST(VtuRead, TakesEveryOrderOfEveryShape) {
  for (const Shape shape : kCells)
    for (int order = 1; order <= 10; ++order) {
      const HighOrderMesh mesh = test::one_cell(shape, order);
      expect_same_elements(mesh, read_back(test::written(mesh, Format::Vtu)), std::string(reference::info(shape).name));
    }
}

// VTK's types of cells in a file, in turn.
std::vector<int> types_in(const std::string& bytes) {
  const test::Folder folder;
  std::ofstream(folder.file("mesh.vtu"), std::ios::binary) << bytes;
  const std::string program = "import vtk; r = vtk.vtkXMLUnstructuredGridReader(); r.SetFileName(\"" +
                              folder.file("mesh.vtu") +
                              "\"); r.Update(); g = r.GetOutput(); print(*[g.GetCellType(i) "
                              "for i in range(g.GetNumberOfCells())])";
  EXPECT_EQ(std::system(("/usr/bin/python3 -c '" + program + "' > '" + folder.file("types") + "'").c_str()), 0);
  std::ifstream types(folder.file("types"));
  return {std::istream_iterator<int>(types), {}};
}

// A line of order P is P lines in the file, whichever way it goes and whether a cell has it or not.
TEST(VtuRead, JoinsThePiecesOfLines) {
  HighOrderMesh mesh = test::one_cell(Shape::Triangle, 3);
  mesh.blocks.push_back({Shape::Line, 3, 1, {5}, {11, 12}, {0, 1, 3, 4, 2, 1, 6, 5}, {}, {}});
  const std::string bytes = test::written(mesh, Format::Vtu);
  expect_same_elements(mesh, read_back(bytes), "lines of the cell");
  mesh.blocks.push_back({Shape::Line, 3, 2, {6}, {13}, {0, 1, 4, 3}, {}, {}});
  const std::string loose = test::written(mesh, Format::Vtu);
  expect_same_elements(mesh, read_back(loose), "a line with other nodes than the cell");
  if (std::system("/usr/bin/python3 -c 'import vtk' >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "SKIPPED: VTK is not installed (python3-vtk9)";
  EXPECT_EQ(types_in(bytes), (std::vector{69, 3, 3, 3, 3, 3, 3}));
  EXPECT_EQ(types_in(loose), (std::vector{69, 3, 3, 3, 3, 3, 3, 3, 3, 3})) << "VTK 9.1 crashes at curved lines";
}

/// The lines that are made of these.
std::vector<ElementBlock> joined(const std::vector<std::int64_t>& numbers, const std::vector<std::int32_t>& nodes) {
  HighOrderMesh mesh = test::one_cell(Shape::Triangle, 3);
  mesh.blocks.push_back({Shape::Line, 1, 1, {5}, numbers, nodes, {}, {}});
  formats::FileAllowance allowance(1000);
  formats::curve_lines(mesh, allowance);
  return {mesh.blocks.begin() + 1, mesh.blocks.end()};
}

TEST(VtuRead, PiecesThatDoNotFitAreLinesOfTheirOwn) {
  const auto whole = joined({11, 0, 0}, {0, 3, 3, 4, 4, 1});
  ASSERT_EQ(whole.size(), 1U);
  EXPECT_EQ(whole[0].nodes, (std::vector<std::int32_t>{0, 1, 3, 4}));
  EXPECT_EQ(whole[0].numbers, std::vector<std::int64_t>{11});
  const auto broken = joined({11, 0, 0}, {0, 3, 3, 4, 5, 6});
  ASSERT_EQ(broken.size(), 2U);
  EXPECT_EQ(broken[0].nodes, (std::vector<std::int32_t>{0, 4, 3}));
  EXPECT_EQ(broken[1].nodes, (std::vector<std::int32_t>{5, 6}));
  EXPECT_EQ(broken[1].numbers, std::vector<std::int64_t>{12}) << "after the largest number";
  const auto straight = joined({11}, {0, 1});
  EXPECT_EQ(straight[0].nodes, (std::vector<std::int32_t>{0, 1, 3, 4})) << "the edge of the cell";
}

TEST(VtuRead, RefusesPyramidsWhoseInnerNodesAreNotListed) {
  std::string bytes = test::written(test::one_cell(Shape::Pyramid, 3), Format::Vtu);
  const std::string name = formats::kVtkPyramids;
  bytes.replace(bytes.find(name), name.size(), std::string(name.size(), 'x'));
  EXPECT_SAYS(bytes, "a pyramid of order 3 or above, whose inner nodes VTK's cells do not have");
}

TEST(VtuRead, TakesEveryTagAndNumberThatIsWritten) {
  HighOrderMesh mesh = test::one_cell(Shape::Triangle, 2);
  mesh.physical_groups[0].tag = std::numeric_limits<std::int32_t>::max();
  mesh.blocks[0].physical = {mesh.physical_groups[0].tag};
  mesh.blocks[0].entity = 2'000'000'000;
  mesh.blocks[0].numbers = {999'999'999'999'999'999};
  const HighOrderMesh back = read_back(test::written(mesh, Format::Vtu));
  expect_same_elements(mesh, back, "large numbers");
  EXPECT_EQ(back.blocks.at(0).entity, mesh.blocks[0].entity);
  ASSERT_EQ(back.physical_groups.size(), 1U);
  EXPECT_EQ(back.physical_groups[0].tag, mesh.physical_groups[0].tag);
}

/// Reads all files of the folder that a script wrote from single cells, and compares them.
/// meshio leaves out the list of the pyramids' nodes.
void expect_rewritten(const std::string& program, const std::string& module, int most, int most_of_pyramids) {
  if (std::system(("/usr/bin/python3 -c 'import " + module + "' >/dev/null 2>&1").c_str()) != 0)
    GTEST_SKIP() << "SKIPPED: " << module << " is not installed";
  const test::Folder folder;
  std::map<std::string, HighOrderMesh> meshes;
  for (const Shape shape : kCells)
    for (int order = 1; order <= (shape == Shape::Pyramid ? most_of_pyramids : most); ++order) {
      const std::string name = std::string(reference::info(shape).name) + "_" + std::to_string(order);
      meshes[name] = test::one_cell(shape, order);
      ASSERT_TRUE(formats::write_file(meshes[name], Format::Vtu, folder.file(name + ".vtu")));
    }
  const std::string script = test::source_file("tests/core/formats/vtu/rewrite_vtu.py");
  ASSERT_EQ(
      std::system(("/usr/bin/python3 '" + script + "' " + program + " '" + folder.path() + "' >/dev/null").c_str()), 0);
  int read = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder.path())) {
    const std::string name = file.path().filename().string();
    if (!name.ends_with(".again.vtu")) continue;
    const auto back = formats::read_file(file.path().string());
    ASSERT_TRUE(back) << back.error().sentence;
    // meshio writes text with twelve digits.
    const double tolerance = program == "meshio" && name.find(".ascii.") != std::string::npos ? 1e-11 : 0;
    expect_same_elements(meshes.at(name.substr(0, name.find('.'))), back->mesh, name, tolerance);
    ++read;
  }
  EXPECT_GE(read, 3 * (5 * most + most_of_pyramids));
}

TEST(VtuRead, ReadsEveryFormThatVtkWrites) { expect_rewritten("vtk", "vtk", 5, 5); }

TEST(VtuRead, ReadsEveryFormThatMeshioWrites) { expect_rewritten("meshio", "meshio", 5, 2); }

// === Cells of fixed order, and errors ====================================================================

/// A grid of text. Points lie on the lattice {0, 1, 2}³.
std::string grid_of(int type, const std::vector<std::array<int, 3>>& nodes, const std::string& version = "0.1") {
  std::string points, list;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (const int x : nodes[i]) points += std::to_string(x / 2.0) + " ";
    list += std::to_string(i) + " ";
  }
  const std::string n = std::to_string(nodes.size());
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"" + version +
         "\" byte_order=\"LittleEndian\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"" + n +
         "\" NumberOfCells=\"1\">\n<Points>\n<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">" +
         points +
         "</DataArray>\n</Points>\n<Cells>\n<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">" + list +
         "</DataArray>\n<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">" + n +
         "</DataArray>\n<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">" + std::to_string(type) +
         "</DataArray>\n</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}

using Nodes = std::vector<std::array<int, 3>>;
const Nodes kQuad9 = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {1, 0, 0},
                      {2, 1, 0}, {1, 2, 0}, {0, 1, 0}, {1, 1, 0}};
// From the documentation of vtkTriQuadraticHexahedron: edges of the base, of the top, upright; faces; centre.
const Nodes kHex27 = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 2}, {2, 0, 2}, {2, 2, 2},
                      {0, 2, 2}, {1, 0, 0}, {2, 1, 0}, {1, 2, 0}, {0, 1, 0}, {1, 0, 2}, {2, 1, 2},
                      {1, 2, 2}, {0, 1, 2}, {0, 0, 1}, {2, 0, 1}, {2, 2, 1}, {0, 2, 1}, {0, 1, 1},
                      {2, 1, 1}, {1, 0, 1}, {1, 2, 1}, {1, 1, 0}, {1, 1, 2}, {1, 1, 1}};

/// Whether each node of the only cell is where its position on the lattice is.
void expect_on_lattice(const std::string& bytes, Shape shape, int order) {
  const HighOrderMesh mesh = read_back(bytes);
  ASSERT_EQ(mesh.blocks.size(), 1U);
  ASSERT_EQ(mesh.blocks[0].shape, shape);
  const auto& lattice = reference::lattice(shape, order);
  for (std::size_t i = 0; i < lattice.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_EQ(mesh.coordinates[3 * std::size_t(mesh.blocks[0].nodes[i]) + k], double(lattice[i][k]) / order) << i;
}

TEST(VtuRead, KnowsTheCellsOfFixedOrder) {
  expect_on_lattice(grid_of(28, kQuad9), Shape::Quadrilateral, 2);
  expect_on_lattice(grid_of(29, kHex27), Shape::Hexahedron, 2);
  expect_on_lattice(grid_of(72, kHex27, "2.2"), Shape::Hexahedron, 2);
  Nodes old = kHex27;
  std::swap(old[18], old[19]);
  expect_on_lattice(grid_of(72, old, "2.0"), Shape::Hexahedron, 2);
  const Nodes voxel = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {2, 2, 0}, {0, 0, 2}, {2, 0, 2}, {0, 2, 2}, {2, 2, 2}};
  expect_on_lattice(grid_of(11, voxel), Shape::Hexahedron, 1);
  // The base of VTK's wedges is clockwise seen from the other triangle; only that of the Lagrange wedge is not.
  const Nodes prism = {{0, 0, 0}, {0, 2, 0}, {2, 0, 0}, {0, 0, 2}, {0, 2, 2}, {2, 0, 2},
                       {0, 1, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 2}, {1, 1, 2}, {1, 0, 2},
                       {0, 0, 1}, {0, 2, 1}, {2, 0, 1}, {0, 1, 1}, {1, 1, 1}, {1, 0, 1}};
  expect_on_lattice(grid_of(32, prism), Shape::Prism, 2);
  expect_on_lattice(grid_of(13, Nodes(prism.begin(), prism.begin() + 6)), Shape::Prism, 1);
  Nodes lagrange = prism;
  for (auto& at : lagrange) std::swap(at[0], at[1]);
  expect_on_lattice(grid_of(73, lagrange), Shape::Prism, 2);
  expect_on_lattice(grid_of(73, Nodes(lagrange.begin(), lagrange.begin() + 6)), Shape::Prism, 1);
  const Nodes tet = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {1, 0, 0},
                     {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  expect_on_lattice(grid_of(24, tet), Shape::Tetrahedron, 2);
}

/// A grid of text with one array of the cell and one of the field data.
std::string grid_with(const std::string& type, const std::string& name, const std::string& value) {
  std::string bytes = grid_of(28, kQuad9);
  const auto before = [&](const std::string& place, const std::string& added) {
    bytes.insert(bytes.find(place), added);
  };
  const std::string array = "<DataArray type=\"" + type + "\" Name=\"" + name + "\" format=\"ascii\">" + value;
  before("</Piece>", "<CellData>" + array + "</DataArray></CellData>");
  before("<Piece", "<FieldData>" + array + " 2</DataArray></FieldData>");
  return bytes;
}

TEST(VtuRead, LeavesOutArraysWithValuesThatNoTagOrNumberHas) {
  const auto block = [](const std::string& type, const std::string& name, const std::string& value) {
    const HighOrderMesh mesh = read_back(grid_with(type, name, value));
    return mesh.blocks.empty() ? ElementBlock{} : mesh.blocks[0];
  };
  for (const std::string type : {"Int64", "UInt64"}) {
    EXPECT_EQ(block(type, "material", "2147483647").physical, std::vector{2147483647});
    for (const std::string value : {"2147483648", "18446744073709551615"}) {
      EXPECT_EQ(block(type, "material", value).physical, std::vector<int>());
      EXPECT_EQ(block(type, "gmsh:geometrical", value).entity, 1);
    }
    EXPECT_EQ(block(type, "element", "999999999999999").numbers, std::vector<std::int64_t>{999'999'999'999'999});
    EXPECT_EQ(block(type, "element", "18446744073709551615").numbers, std::vector<std::int64_t>{1});
  }
  EXPECT_EQ(block("Int32", "material", "-2147483648").physical, std::vector<int>());
}

TEST(VtuReadErrors, AreSaid) {
  const std::string whole = grid_of(28, kQuad9);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = whole;
    EXPECT_NE(changed.find(from), std::string::npos) << from;
    return changed.replace(changed.find(from), from.size(), to);
  };
  EXPECT_SAYS(whole, "it was read");
  EXPECT_SAYS(with(" 8 </DataArray>", " <!-- the last -->8 </DataArray>"), "it was read");
  EXPECT_SAYS(with(">28</DataArray>", "><!-- one\ntype -->28<!-- -- ></DataArray>"), "not well-formed");
  EXPECT_SAYS(with("UnstructuredGrid", "PolyData"), "reads UnstructuredGrid");
  EXPECT_SAYS(with("byte_order", "compressor=\"vtkLZ4DataCompressor\" byte_order"), "compressed with vtkLZ4");
  EXPECT_SAYS(with("NumberOfPoints=\"9\"", "NumberOfPoints=\"8\""), "has 27 values; 24 were expected");
  EXPECT_SAYS(with("NumberOfPoints=\"9\"", "NumberOfPoints=\"-1\""), "not a number from 0");
  EXPECT_SAYS(with("NumberOfCells=\"1\"", "NumberOfCells=\"2\""), "2 were expected");
  EXPECT_SAYS(with(" 8 </DataArray>", " 9 </DataArray>"), "refers to point 9, but the points are 0 to 8");
  EXPECT_SAYS(with(">9</DataArray>", ">10</DataArray>"), "the offsets of the cells");
  EXPECT_SAYS(with(">28</DataArray>", ">23</DataArray>"), "type 23 has 9 nodes");
  EXPECT_SAYS(with(">28</DataArray>", ">77</DataArray>"), "Bézier");
  EXPECT_SAYS(with(">28</DataArray>", ">71</DataArray>"), "which no tetrahedron of order 1 to 10 has");
  EXPECT_SAYS(with("Int32", "Float64"), "whole numbers");
  EXPECT_SAYS(with("Int32", "String"), "unknown type 'String'");
  EXPECT_SAYS(with("format=\"ascii\"", "format=\"appended\" offset=\"0\""), "no AppendedData");
  EXPECT_SAYS(with("format=\"ascii\"", "format=\"binary\""), "base64");
  EXPECT_SAYS(with("connectivity", "elsewhere"), "no array 'connectivity'");
}

std::vector<std::string> sound_files() {
  return {grid_of(29, kHex27), test::written(testing::grid(Filling::MixedSolid, {3, 1, 1}, 2), Format::Vtu)};
}

TEST(DamagedVtuFile, IsRefusedWhereverItIsCutShort) {
  // What follows the last array that is read means nothing.
  const std::vector<std::string> files = sound_files();
  testing::expect_refused_if_cut(files[0], files[0].find("</UnstructuredGrid>"));
  const std::string data = "<AppendedData encoding=\"raw\">\n_",
                    last = "Name=\"dimension\" format=\"appended\" offset=\"";
  const std::size_t offset = std::stoul(files[1].substr(files[1].find(last) + last.size()));
  testing::expect_refused_if_cut(files[1], files[1].find(data) + data.size() + offset - 4);
}

TEST(DamagedVtuFile, IsReadOrRefusedWithFlippedBytes) {
  for (const std::string& whole : sound_files()) testing::expect_survives_flips(whole, 2000);
}

}  // namespace
}  // namespace varimesh
