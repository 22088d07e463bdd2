// A format of one file and one row of the table, as docs/extending.md describes it: reading recognises its files, and
// writing finds it by its name and by its extension.
#include <gtest/gtest.h>

#include <sstream>
#include <vector>

#include "core/formats/format_table.h"
#include "core/formats/numbering/node_order.h"
#include "tests/core/support/samples.h"

namespace varimesh::formats {
namespace {

constexpr auto kTriangles = Format(100);

// === The format: triangles in the plane as text, with their nodes row by row =============================

bool begins_like_triangles(std::string_view bytes) { return bytes.starts_with("triangles\n"); }

Expected<MeshFile> read_triangles(std::string_view bytes, const Team&) {
  std::istringstream text{std::string(bytes.substr(bytes.find('\n')))};
  std::size_t nodes = 0, triangles = 0;
  HighOrderMesh mesh;
  mesh.dimension = 2;
  text >> mesh.order >> nodes >> triangles;
  if (!text || mesh.order < 1 || mesh.order > kMaxOrder) return bad_input("The first line of the triangles is wrong.");
  for (std::size_t n = 0; n < nodes && text; ++n) {
    double x = 0, y = 0;
    text >> x >> y;
    mesh.coordinates.insert(mesh.coordinates.end(), {x, y, 0});
    mesh.node_numbers.push_back(std::int64_t(n) + 1);
  }
  ElementBlock block;
  block.shape = Shape::Triangle;
  block.order = mesh.order;
  const std::vector<int>& in_gmsh = gmsh_nodes(NodeOrder::Rows, block.shape, block.order);
  for (std::size_t t = 0; t < triangles && text; ++t) {
    block.numbers.push_back(std::int64_t(t) + 1);
    const std::size_t first = block.nodes.size();
    block.nodes.resize(first + in_gmsh.size());
    for (const int node : in_gmsh) text >> block.nodes[first + std::size_t(node)];
  }
  if (!text) return bad_input("The file of triangles ends too early; write it again.");
  mesh.blocks.push_back(std::move(block));
  return MeshFile{std::move(mesh), kTriangles};
}

Expected<void> write_triangles(const HighOrderMesh& mesh, Format, const Sink& sink, std::span<const CellField>,
                               const Team&) {
  std::ostringstream text;
  text.precision(17);
  const ElementBlock& block = mesh.blocks.at(0);
  text << "triangles\n" << mesh.order << " " << mesh.node_count() << " " << block.size() << "\n";
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    text << mesh.coordinates[3 * n] << " " << mesh.coordinates[3 * n + 1] << "\n";
  const std::vector<int>& in_gmsh = gmsh_nodes(NodeOrder::Rows, block.shape, block.order);
  for (std::size_t t = 0; t < block.size(); ++t)
    for (const int node : in_gmsh) text << block.nodes[t * in_gmsh.size() + std::size_t(node)] << "\n";
  if (sink(text.str())) return {};
  return tl::unexpected<Error>({Error::Kind::Output, "Writing stopped before the end of the mesh."});
}

/// The library's formats and the new one.
std::vector<FormatEntry> table() {
  std::vector<FormatEntry> entries(format_table().begin(), format_table().end());
  entries.push_back({kTriangles, "triangles", ".tri", begins_like_triangles, read_triangles, write_triangles});
  return entries;
}

// === The tests ===========================================================================================

std::string written(const HighOrderMesh& mesh, Format format) {
  std::string bytes;
  const auto done = write(table(), mesh, format, [&](std::string_view more) { return bytes.append(more), true; }, {});
  EXPECT_TRUE(done) << done.error().sentence;
  return bytes;
}

TEST(AddedFormat, IsReadAndWrittenWithoutLoss) {
  for (int order = 1; order <= 5; ++order) {
    const HighOrderMesh mesh = test::one_cell(Shape::Triangle, order);
    const std::string bytes = written(mesh, kTriangles);
    const auto file = read(table(), bytes);
    ASSERT_TRUE(file) << file.error().sentence;
    EXPECT_EQ(file->format, kTriangles);
    EXPECT_EQ(file->mesh.coordinates, mesh.coordinates);
    EXPECT_EQ(file->mesh.blocks.at(0).nodes, mesh.blocks.at(0).nodes);
    EXPECT_EQ(written(file->mesh, kTriangles), bytes);
  }
}

// The corners of a quadratic triangle are 0, 1 and 2 in Gmsh's order, and ends of rows here.
TEST(AddedFormat, ListsItsNodesRowByRow) {
  EXPECT_TRUE(written(test::one_cell(Shape::Triangle, 2), kTriangles).ends_with("\n0\n3\n1\n5\n4\n2\n"));
}

TEST(AddedFormat, ReportsItsErrorsAndLeavesOtherFilesToOtherFormats) {
  const auto file = read(table(), "triangles\n1 3 1\n0 0\n");
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().sentence, "The file of triangles ends too early; write it again.");
  const auto other = read(table(), written(test::one_cell(Shape::Triangle, 1), Format::Msh41));
  ASSERT_TRUE(other) << other.error().sentence;
  EXPECT_EQ(other->format, Format::Msh41);
  EXPECT_FALSE(read(table(), "neither\n"));
}

TEST(AddedFormat, IsFoundByItsNameAndItsExtension) {
  EXPECT_EQ(from_name(table(), "triangles").value(), kTriangles);
  EXPECT_NE(from_name(table(), "squares").error().sentence.find("pyfr, triangles"), std::string::npos);
  EXPECT_EQ(for_output(table(), "mesh.tri", Format::Auto, Format::Msh22).value(), kTriangles);
  EXPECT_EQ(for_output(table(), "mesh.TRI", kTriangles, Format::Auto).value(), kTriangles);
  EXPECT_FALSE(for_output(table(), "mesh.tri", Format::Vtu, Format::Auto));
  EXPECT_FALSE(for_output(table(), "mesh.vtu", kTriangles, Format::Auto));
  EXPECT_EQ(for_output(table(), "mesh.msh", Format::Auto, kTriangles).value(), Format::Msh41Binary);
}

TEST(AddedFormat, MayBeOnlyReadOrOnlyWritten) {
  std::vector<FormatEntry> entries = table();
  entries.back().write = nullptr;
  const auto done =
      write(entries, test::one_cell(Shape::Triangle, 1), kTriangles, [](std::string_view) { return true; }, {});
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().kind, Error::Kind::BadOption);
  EXPECT_FALSE(for_output(entries, "mesh.tri", Format::Auto, Format::Auto));
  entries.back() = {kTriangles, "triangles", ".tri", nullptr, nullptr, write_triangles};
  EXPECT_FALSE(read(entries, "triangles\n0 0\n"));
}

}  // namespace
}  // namespace varimesh::formats
