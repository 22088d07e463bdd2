// Numbers, groups and coordinates that are read from an MSH file are written back bit for bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using test::one_cell;
using test::source_file;
using test::written;

const Format kGmsh[] = {Format::Msh22, Format::Msh22Binary, Format::Msh41, Format::Msh41Binary};
const Shape kCells[] = {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron,
                        Shape::Pyramid,  Shape::Prism,         Shape::Hexahedron};

// Number, shape, order, groups and node numbers of an element, for sets of them.
using ElementKey = std::tuple<std::int64_t, Shape, int, std::vector<int>, std::vector<std::int64_t>>;

std::set<ElementKey> elements_of(const HighOrderMesh& mesh) {
  std::set<ElementKey> all;
  for (const ElementBlock& block : mesh.blocks) {
    const auto stride = std::size_t(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e) {
      std::vector<std::int64_t> nodes;
      for (std::size_t k = 0; k < stride; ++k)
        nodes.push_back(mesh.node_numbers[std::size_t(block.nodes[e * stride + k])]);
      all.insert({block.numbers[e], block.shape, block.order, block.physical, nodes});
    }
  }
  return all;
}

std::set<std::tuple<std::int64_t, double, double, double>> nodes_of(const HighOrderMesh& mesh) {
  std::set<std::tuple<std::int64_t, double, double, double>> all;
  for (std::size_t i = 0; i < mesh.node_count(); ++i)
    all.insert(
        {mesh.node_numbers[i], mesh.coordinates[3 * i], mesh.coordinates[3 * i + 1], mesh.coordinates[3 * i + 2]});
  return all;
}

void expect_same(const HighOrderMesh& a, const HighOrderMesh& b) {
  EXPECT_EQ(nodes_of(a), nodes_of(b));
  EXPECT_EQ(elements_of(a), elements_of(b));
  EXPECT_EQ(a.dimension, b.dimension);
  EXPECT_EQ(a.order, b.order);
  EXPECT_EQ(a.physical_groups.size(), b.physical_groups.size());
}

TEST(GmshRoundTrip, EveryShapeAndOrderInEveryVersion) {
  for (Shape shape : kCells)
    for (int order = 1; order <= (shape <= Shape::Tetrahedron ? 10 : 9); ++order)
      for (Format format : kGmsh) {
        const HighOrderMesh mesh = one_cell(shape, order);
        const auto back = formats::read(written(mesh, format));
        ASSERT_TRUE(back) << back.error().sentence;
        EXPECT_EQ(back->format, format);
        expect_same(mesh, back->mesh);
        EXPECT_EQ(back->mesh.physical_groups[0].name, "the cell");
      }
}

TEST(GmshRoundTrip, OrderTenOfTensorShapesHasNoTypeNumber) {
  for (Shape shape : {Shape::Hexahedron, Shape::Prism, Shape::Pyramid}) {
    const auto done = formats::write(one_cell(shape, 10), Format::Msh41, [](std::string_view) { return true; });
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().kind, Error::Kind::BadOption);
    EXPECT_NE(done.error().sentence.find("order 10"), std::string::npos);
  }
}

TEST(GmshRoundTrip, OwnFormatGivesTheSameBytesAfterTheFirstTime) {
  for (const char* name : {"nine_triangles.msh", "circle_p5.msh", "cylinder_p2.msh", "sphere_p3.msh", "annulus_p3.msh"})
    for (Format format : kGmsh) {
      const auto mesh = formats::read_file(source_file(std::string("tests/cases/") + name));
      ASSERT_TRUE(mesh) << mesh.error().sentence;
      const std::string once = written(mesh->mesh, format);
      const auto again = formats::read(once);
      ASSERT_TRUE(again) << again.error().sentence;
      EXPECT_EQ(once, written(again->mesh, format)) << name;
      expect_same(mesh->mesh, again->mesh);
    }
}

TEST(GmshRoundTrip, GmshsOwnBinaryComesBackByteForByte) {
  const std::string original = test::slurp(source_file("tests/cases/sphere_p3.msh"));
  const auto mesh = formats::read(original);
  ASSERT_TRUE(mesh);
  EXPECT_EQ(original, written(mesh->mesh, mesh->format));
}

TEST(GmshRoundTrip, TheFourVariantsOfOneMeshAreTheSame) {
  if (!std::filesystem::exists(test::shared_case("sph276_p5.msh"))) GTEST_SKIP() << "SKIPPED: no shared cases here";
  const auto first = formats::read_file(test::shared_case("sph276_p5.msh"));
  ASSERT_TRUE(first);
  for (const char* name : {"sph276_p5.22b.msh", "sph276_p5.41a.msh", "sph276_p5.41b.msh"}) {
    const auto other = formats::read_file(test::shared_case(name));
    ASSERT_TRUE(other) << other.error().sentence;
    EXPECT_EQ(first->mesh.node_count(), other->mesh.node_count());
    for (int d = 0; d < 4; ++d) EXPECT_EQ(first->mesh.element_count(d), other->mesh.element_count(d));
    // Gmsh's text has 16 digits, so ASCII and binary agree only up to rounding.
    std::multiset<double> a, b;
    for (double x : first->mesh.coordinates) a.insert(std::round(x * 1e12) / 1e12 + 0.0);
    for (double x : other->mesh.coordinates) b.insert(std::round(x * 1e12) / 1e12 + 0.0);
    EXPECT_EQ(a, b) << name;
  }
}

// === Groups ==============================================================================================

const char* const kTwoGroups =
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 7 \"se \"ven\"\n$EndPhysicalNames\n"
    "$Nodes\n4\n10 0 0 0\n20 1 0 0\n30 1 1 0\n40 0 1 0.1e-1\n$EndNodes\n"
    "$Elements\n4\n1 2 2 1 9 10 20 30\n2 2 2 7 9 10 20 30\n3 2 2 1 9 10 30 40\n4 2 2 7 9 10 30 40\n$EndElements\n";

TEST(GmshGroups, RepeatedElementsOfMsh22BecomeOneInSeveralGroups) {
  const auto mesh = formats::read(kTwoGroups);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  ASSERT_EQ(mesh->mesh.blocks.size(), 1u);
  EXPECT_EQ(mesh->mesh.blocks[0].size(), 2u);
  EXPECT_EQ(mesh->mesh.blocks[0].physical, (std::vector{1, 7}));
  EXPECT_EQ(mesh->mesh.physical_groups[0].name, "se \"ven");
}

TEST(GmshGroups, TheyAreRepeatedUnderTheirOwnNumbersAgain) {
  const auto mesh = formats::read(kTwoGroups);
  const std::string text = written(mesh->mesh, Format::Msh22);
  for (const char* line : {"\n1 2 2 1 9 10 20 30\n", "\n2 2 2 7 9 10 20 30\n", "\n4 2 2 7 9 10 30 40\n"})
    EXPECT_NE(text.find(line), std::string::npos) << text;
}

TEST(GmshGroups, BothGroupsSurviveMsh41AndBack) {
  const auto mesh = formats::read(kTwoGroups);
  const auto there = formats::read(written(mesh->mesh, Format::Msh41));
  ASSERT_TRUE(there) << there.error().sentence;
  EXPECT_EQ(there->mesh.blocks[0].physical, (std::vector{1, 7}));
  const auto back = formats::read(written(there->mesh, Format::Msh22Binary));
  ASSERT_TRUE(back) << back.error().sentence;
  EXPECT_EQ(back->mesh.blocks[0].physical, (std::vector{1, 7}));
  EXPECT_EQ(back->mesh.blocks[0].size(), 2u);
}

TEST(GmshGroups, OneEntityInDifferentGroupsIsSplitForMsh41) {
  std::string text = kTwoGroups;
  text.replace(text.find("4\n1 2 2 1 9"), std::string::npos,
               "2\n1 2 2 1 9 10 20 30\n2 2 2 7 9 10 30 40\n$EndElements\n");
  const auto mesh = formats::read(text);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  const auto there = formats::read(written(mesh->mesh, Format::Msh41Binary));
  ASSERT_TRUE(there) << there.error().sentence;
  expect_same(mesh->mesh, there->mesh);
  EXPECT_NE(there->mesh.blocks[0].entity, there->mesh.blocks[1].entity);
}

// === The rest of a file ==================================================================================

TEST(GmshSections, ForeignOnesComeBackInTheSameFormatAndNoOther) {
  const std::string text = std::string(kTwoGroups) + "$NodeData\n1\n\"field\"\n1\n0.5\n$EndNodeData\n";
  const auto mesh = formats::read(text);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  EXPECT_NE(written(mesh->mesh, Format::Msh22).find("$NodeData\n1\n\"field\"\n1\n0.5\n$EndNodeData\n"),
            std::string::npos);
  EXPECT_EQ(written(mesh->mesh, Format::Msh41).find("$NodeData"), std::string::npos);
}

TEST(GmshSections, PeriodicLinksGoThroughEveryVersion) {
  const std::string text =
      std::string(kTwoGroups) +
      "$Periodic\n1\n1 2 4\nAffine 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1\n2\n20 10\n30 40\n$EndPeriodic\n";
  const auto mesh = formats::read(text);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  for (Format format : kGmsh) {
    const auto back = formats::read(written(mesh->mesh, format));
    ASSERT_TRUE(back) << back.error().sentence;
    ASSERT_EQ(back->mesh.periodic.size(), 1u);
    const PeriodicLink& link = back->mesh.periodic[0];
    EXPECT_EQ(link.affine.size(), 16u);
    ASSERT_EQ(link.nodes.size(), 2u);
    EXPECT_EQ(back->mesh.node_numbers[std::size_t(link.nodes[1].first)], 30);
    EXPECT_EQ(back->mesh.node_numbers[std::size_t(link.nodes[1].second)], 40);
  }
}

TEST(GmshSections, PartitionsOfMsh22AreKept) {
  std::string text = kTwoGroups;
  text.replace(text.find("4\n1 2 2 1 9"), std::string::npos,
               "2\n1 2 5 1 9 2 1 -2 10 20 30\n2 2 4 1 9 1 2 10 30 40\n$EndElements\n");
  const auto mesh = formats::read(text);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  EXPECT_NE(written(mesh->mesh, Format::Msh22).find("1 2 5 1 9 2 1 -2 10 20 30\n2 2 4 1 9 1 2 10 30 40\n"),
            std::string::npos);
}

TEST(GmshSections, WindowsLineEndsAreRead) {
  std::string text;
  for (const char* c = kTwoGroups; *c; ++c) text += *c == '\n' ? std::string("\r\n") : std::string(1, *c);
  const auto mesh = formats::read(text);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  EXPECT_EQ(mesh->mesh.physical_groups[0].name, "se \"ven");
}

TEST(GmshRoundTrip, ParametersOfNodesStayInVersion41) {
  HighOrderMesh mesh = one_cell(Shape::Tetrahedron, 2);
  mesh.node_blocks = {{0, 1, 0, 1}, {1, 3, 1, 2, {0.1, 1.0 / 3}}, {2, 7, 3, 2, {1, -2, 3e-300, 4}}, {3, 1, 5, 5}};
  for (const Format format : {Format::Msh41, Format::Msh41Binary}) {
    const std::string text = written(mesh, format);
    const auto back = formats::read(text);
    ASSERT_TRUE(back) << back.error().sentence;
    ASSERT_EQ(back->mesh.node_blocks.size(), 4U);
    for (std::size_t b = 0; b < 4; ++b)
      EXPECT_EQ(back->mesh.node_blocks[b].parameters, mesh.node_blocks[b].parameters) << b;
    EXPECT_EQ(written(back->mesh, format), text);
  }
  const auto back = formats::read(written(mesh, Format::Msh22));
  ASSERT_TRUE(back) << back.error().sentence;
  for (const NodeBlock& block : back->mesh.node_blocks) EXPECT_TRUE(block.parameters.empty());
}

TEST(GmshRoundTrip, TheParametersOfAVolumeAreLeftOut) {
  const std::string text =
      "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n2 4 1 4\n2 1 1 3\n1\n2\n3\n0 0 0 .5 .25\n1 0 0 1 2\n"
      "0 1 0 3 4\n3 1 1 1\n4\n0 0 1 7 8 9\n$EndNodes\n$Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n";
  const auto mesh = formats::read(text);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  EXPECT_EQ(mesh->mesh.coordinates, (std::vector<double>{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}));
  EXPECT_EQ(mesh->mesh.node_blocks[0].parameters, (std::vector<double>{.5, .25, 1, 2, 3, 4}));
  EXPECT_TRUE(mesh->mesh.node_blocks[1].parameters.empty());
  EXPECT_TRUE(formats::read(written(mesh->mesh, Format::Msh41)));
}

TEST(GmshNumbers, SparseAndHugeNodeNumbersAreFound) {
  HighOrderMesh mesh = one_cell(Shape::Triangle, 3);
  for (std::size_t i = 0; i < mesh.node_count(); ++i) mesh.node_numbers[i] = 5'000'000'000 - 77 * std::int64_t(i * i);
  for (Format format : {Format::Msh22, Format::Msh41, Format::Msh41Binary}) {
    const auto back = formats::read(written(mesh, format));
    ASSERT_TRUE(back) << back.error().sentence;
    expect_same(mesh, back->mesh);
  }
  EXPECT_NE(written(mesh, Format::Msh22Binary).find("2147483647"), std::string::npos);
}

TEST(GmshNumbers, NewNumbersOfRepeatedElementsMustFitIntoBinaryMsh22) {
  HighOrderMesh mesh = one_cell(Shape::Triangle, 1);
  mesh.blocks[0].numbers = {2147483646};
  mesh.blocks[0].physical = {5, 6};
  const auto back = formats::read(written(mesh, Format::Msh22Binary));
  ASSERT_TRUE(back) << back.error().sentence;
  EXPECT_EQ(back->mesh.blocks[0].repeat_numbers, std::vector<std::int64_t>{2147483647});
  mesh.blocks[0].physical = {5, 6, 7};
  EXPECT_NE(written(mesh, Format::Msh22Binary).find("numbers above 2147483647"), std::string::npos);
}

TEST(GmshNumbers, TextGivesTheSameDoubles) {
  HighOrderMesh mesh = one_cell(Shape::Triangle, 1);
  mesh.coordinates = {0.1, 1.0 / 3, 5e-324, -0.0, 1.7976931348623157e308, 123456789.123456789, 2e-17, 1e22, 3};
  const auto back = formats::read(written(mesh, Format::Msh41));
  ASSERT_TRUE(back) << back.error().sentence;
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(mesh.coordinates[i], back->mesh.coordinates[i]);
    EXPECT_EQ(std::signbit(mesh.coordinates[i]), std::signbit(back->mesh.coordinates[i]));
  }
}

}  // namespace
}  // namespace varimesh
