// Bad files are refused with a sentence that says what is wrong and where. No file does any other harm.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;

const std::string kHead = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
const std::string kNodes = "$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n";

std::string why_not(const std::string& bytes) {
  const auto mesh = formats::read(bytes);
  return mesh ? "it was read" : mesh.error().sentence;
}

#define EXPECT_SAYS(bytes, words) EXPECT_NE(why_not(bytes).find(words), std::string::npos) << why_not(bytes)

TEST(GmshErrors, NotAMesh) {
  EXPECT_SAYS("", "empty");
  EXPECT_SAYS("hello\n", "not a mesh");
  EXPECT_SAYS("<?xml version=\"1.0\"?><VTKFile>", "UnstructuredGrid (.vtu)");
  EXPECT_SAYS("$Hello\nworld\n", "$MeshFormat must come first");
}

TEST(GmshErrors, VersionsThatAreNotRead) {
  EXPECT_SAYS("$MeshFormat\n3 0 8\n$EndMeshFormat\n", "3.0");
  EXPECT_SAYS("$MeshFormat\n4.15 0 8\n$EndMeshFormat\n", "4.1");
  EXPECT_SAYS("$MeshFormat\n1 0 8\n$EndMeshFormat\n", "write 2.2 or 4.1");
  EXPECT_SAYS("$MeshFormat\n4.1 0 4\n$EndMeshFormat\n", "data size");
}

TEST(GmshErrors, OtherByteOrder) {
  EXPECT_SAYS(std::string("$MeshFormat\n4.1 1 8\n\0\0\0\1\n$EndMeshFormat\n", 40), "byte order");
}

TEST(GmshErrors, TruncatedFileNamesTheByte) {
  const std::string whole = kHead + kNodes;
  EXPECT_SAYS(whole.substr(0, whole.size() - 20), "ends at byte " + std::to_string(whole.size() - 20));
  EXPECT_SAYS(whole.substr(0, whole.size() - 20), "inside $Nodes");
  EXPECT_SAYS(whole, "$Elements");
}

TEST(GmshErrors, UnknownElementTypeNamesItAndTheLine) {
  EXPECT_SAYS(kHead + kNodes + "$Elements\n1\n1 77 2 1 1 1 2 3\n$EndElements\n", "element type 77 is not known");
  EXPECT_SAYS(kHead + kNodes + "$Elements\n1\n1 0 0 1\n$EndElements\n", "element type 0 is not known");
  EXPECT_SAYS(kHead + kNodes + "$Elements\n1\n1 77 2 1 1 1 2 3\n$EndElements\n", "line 12");
}

TEST(GmshErrors, NegativeElementNumber) {
  EXPECT_SAYS(kHead + kNodes + "$Elements\n1\n-7 2 2 1 1 1 2 3\n$EndElements\n", "element number -7 is negative");
  EXPECT_SAYS(kHead + kNodes + "$Elements\n1\n-7 2 2 1 1 1 2 3\n$EndElements\n", "line 12");
}

TEST(GmshErrors, NegativeElementNumberInTheOtherVersions) {
  EXPECT_SAYS(
      "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n"
      "$Elements\n1 1 1 1\n2 1 2 1\n-7 1 2 3\n$EndElements\n",
      "element number -7 is negative");
  EXPECT_SAYS(
      "$MeshFormat\n4 0 8\n$EndMeshFormat\n$Nodes\n1 3\n1 2 0 3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n"
      "$Elements\n1 1\n1 2 2 1\n-7 1 2 3\n$EndElements\n",
      "element number -7 is negative");
}

TEST(GmshErrors, AnAffineMapWithAnotherName) {
  EXPECT_SAYS(kHead + kNodes + "$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n$Periodic\n1\n1 1 2\nA\n",
              "which begins with 'Affine'");
}

TEST(GmshErrors, TheLargestTagHasNoSuccessor) {
  // The group of the second block is not that of its entity, so it needs an entity of its own.
  const auto file = formats::read(
      kHead + kNodes + "$Elements\n2\n1 2 2 1 2147483647 1 2 3\n2 2 2 2 2147483647 1 3 2\n" + "$EndElements\n");
  ASSERT_TRUE(file) << file.error().sentence;
  std::string bytes;
  ASSERT_TRUE(formats::write(file->mesh, Format::Msh41, [&](std::string_view piece) {
    bytes += piece;
    return true;
  }));
  const auto back = formats::read(bytes);
  ASSERT_TRUE(back) << back.error().sentence;
  ASSERT_EQ(back->mesh.blocks.size(), 2u);
  EXPECT_EQ(back->mesh.blocks[0].entity, 2147483647);
  EXPECT_EQ(back->mesh.blocks[1].entity, 1);
}

TEST(GmshErrors, NumbersOfManyDigits) {
  EXPECT_SAYS(kHead + "$Nodes\n99999999999999999999999999\n", "was expected, found '9999999999");
}

TEST(GmshErrors, ANameOfSeveralLinesIsWrittenOnOne) {
  auto file = formats::read(kHead + kNodes + "$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n");
  ASSERT_TRUE(file) << file.error().sentence;
  file->mesh.physical_groups = {{2, 1, "two\nlines \"quoted\"\t"}};  // as MFEM and MeshPart messages may have it
  std::string bytes;
  ASSERT_TRUE(formats::write(file->mesh, Format::Msh41, [&](std::string_view piece) {
    bytes += piece;
    return true;
  }));
  const auto back = formats::read(bytes);
  ASSERT_TRUE(back) << back.error().sentence;
  EXPECT_EQ(back->mesh.physical_groups.at(0).name, "two lines \"quoted\" ");
}

TEST(GmshErrors, AnElementInManyGroupsIsReadInLinearTime) {
  // Comparing each group with all before it would take longer than a test may.
  constexpr int kGroups = 1'000'000;
  std::string elements = "$Elements\n" + std::to_string(kGroups) + "\n";
  for (int i = 1; i <= kGroups; ++i) elements += std::to_string(i) + " 2 2 " + std::to_string(i) + " 1 1 2 3\n";
  const auto file = formats::read(kHead + kNodes + elements + "$EndElements\n");
  ASSERT_TRUE(file) << file.error().sentence;
  ASSERT_EQ(file->mesh.blocks.size(), 1u);
  EXPECT_EQ(file->mesh.blocks[0].size(), 1u);
  EXPECT_EQ(file->mesh.blocks[0].physical.size(), static_cast<std::size_t>(kGroups));
  EXPECT_EQ(file->mesh.blocks[0].repeat_numbers.size(), static_cast<std::size_t>(kGroups - 1));
}

TEST(GmshErrors, IncompleteElementsWithoutKnownFunctionsAreDistinguishedFromUnknownOnes) {
  for (int type : {32, 33, 83, 111, 117, 125, 131, 137})
    EXPECT_SAYS(kHead + kNodes + "$Elements\n1\n1 " + std::to_string(type) + " 2 1 1 1 2 3\n$EndElements\n",
                "Mesh.SecondOrderIncomplete=0");
}

TEST(GmshErrors, NodeThatIsNotThere) {
  EXPECT_SAYS(kHead + kNodes + "$Elements\n1\n8 2 2 1 1 1 2 4\n$EndElements\n", "element 8 refers to node 4");
  EXPECT_SAYS(kHead + kNodes + "$Elements\n1\n8 2 2 1 1 1 2 -4\n$EndElements\n", "element 8 refers to node -4");
}

TEST(GmshErrors, NodeNumbersThatAreWrong) {
  EXPECT_SAYS(kHead + "$Nodes\n2\n5 0 0 0\n5 1 0 0\n$EndNodes\n", "node number 5 appears twice");
  EXPECT_SAYS(kHead + "$Nodes\n2\n0 0 0 0\n5 1 0 0\n$EndNodes\n", "not positive");
}

TEST(GmshErrors, CountsThatNothingCanHold) {
  EXPECT_SAYS(kHead + "$Nodes\n99999999999999\n1 0 0 0\n", "the number of nodes, 99999999999999, exceeds 2147483647");
  EXPECT_SAYS(kHead + "$Nodes\n-1\n", "negative");
  EXPECT_SAYS(kHead + kNodes + "$Elements\n2\n1 2 2 1 1 1 2 3\n$EndElements\n", "was expected, found '$EndElements'");
}

TEST(GmshErrors, WordsWhereNumbersBelong) {
  EXPECT_SAYS(kHead + "$Nodes\n1\n1 0 zero 0\n$EndNodes\n", "found 'zero' (in $Nodes, line 6");
}

TEST(GmshErrors, SectionsOutOfOrder) {
  EXPECT_SAYS(kHead + "$Elements\n0\n$EndElements\n" + kNodes, "before $Nodes");
  EXPECT_SAYS(kHead + kNodes + kNodes, "second section");
}

// === Damaged files =======================================================================================
// Each is either read or refused with a sentence. Under the sanitizers this also shows that no buffer is overrun.

class DamagedFile : public testing::TestWithParam<Format> {
 protected:
  std::string valid() const {
    const auto mesh = formats::read_file(test::source_file("tests/cases/nine_triangles.msh"));
    HighOrderMesh with_links = mesh->mesh;
    with_links.periodic.push_back({1, 1, 1, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, {{0, 1}, {2, 3}}});
    return test::written(with_links, GetParam());
  }
};

TEST_P(DamagedFile, TruncatedAnywhere) {
  const std::string whole = valid();
  ASSERT_TRUE(formats::read(whole));
  for (std::size_t k = 0; k < 200; ++k) {
    const std::string cut = whole.substr(0, k * whole.size() / 200);
    const auto mesh = formats::read(cut);
    EXPECT_TRUE(mesh || mesh.error().sentence.size() > 20);
    EXPECT_TRUE(!mesh || cut.size() >= whole.find("$EndElements")) << "cut at byte " << cut.size();
  }
}

TEST_P(DamagedFile, WithFlippedBytes) {
  const std::string whole = valid();
  std::mt19937 random(20160926);
  for (int k = 0; k < 500; ++k) {
    std::string damaged = whole;
    damaged[random() % damaged.size()] = char(random() & 0xff);
    const auto mesh = formats::read(damaged);
    if (!mesh) {
      EXPECT_GT(mesh.error().sentence.size(), 20u);
    } else {
      for (const ElementBlock& block : mesh->mesh.blocks)
        for (std::int32_t node : block.nodes) ASSERT_LT(std::size_t(node), mesh->mesh.node_count());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(EveryVersion, DamagedFile,
                         testing::Values(Format::Msh22, Format::Msh22Binary, Format::Msh41, Format::Msh41Binary),
                         [](const auto& info) {
                           std::string name = ::testing::PrintToString(info.param);
                           std::ranges::replace(name, '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace varimesh
