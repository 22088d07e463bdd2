// Bad files of MFEM are refused with a sentence that says what is wrong and where.
#include <gtest/gtest.h>

#include "core/formats/mfem/mfem.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;

const std::string kHead = "MFEM mesh v1.0\n# a comment\n\ndimension\n2\n\n";
const std::string kElements = "elements\n2\n1 2 0 1 2\n1 2 1 3 2\n\nboundary\n1\n3 1 0 1\n\n";
const std::string kVertices = "vertices\n4\n2\n0 0\n1 0\n0 1\n1 1\n";

std::string nodes(const std::string& space, int count, const std::string& ordering = "1") {
  std::string text = "vertices\n4\n\nnodes\nFiniteElementSpace\nFiniteElementCollection: " + space +
                     "\nVDim: 2\nOrdering: " + ordering + "\n\n";
  for (int i = 0; i < count; ++i) text += std::to_string(i % 2) + " " + std::to_string(i / 2 % 2) + "\n";
  return text;
}

TEST(MfemErrors, ReadsTheMeshThatTheyDamage) {
  const auto file = formats::read(kHead + kElements + kVertices);
  ASSERT_TRUE(file) << file.error().sentence;
  EXPECT_EQ(file->format, Format::Mfem);
  EXPECT_EQ(file->mesh.element_count(2), 2U);
  EXPECT_EQ(file->mesh.element_count(1), 1U);
  EXPECT_EQ(file->mesh.blocks[1].physical, std::vector<int>{3});
  EXPECT_EQ(testing::why_not(kHead + kElements + nodes("H1_2D_P1", 4)), "it was read");
}

TEST(MfemErrors, CoordinatesThatAreNotFinite) {
  const std::string fault = " has a coordinate that is not a finite number";
  EXPECT_SAYS(kHead + kElements + "vertices\n4\n2\n0 0\n1 nan\n0 1\n1 1\n", "vertex 1 (counted from 0)" + fault);
  const auto damaged = [](std::string text) { return text.replace(text.rfind("\n1 1"), 4, "\n1 inf"); };
  EXPECT_SAYS(kHead + kElements + damaged(nodes("H1_2D_P1", 4)), "degree of freedom 3 (counted from 0)" + fault);
  EXPECT_SAYS(kHead + kElements + damaged(nodes("L2_T1_2D_P1", 6)), "a node of element 2" + fault);
}

TEST(MfemErrors, KindsOfMeshesThatAreNotTaken) {
  EXPECT_SAYS("MFEM NURBS mesh v1.0\n", "Mesh::SetCurvature(order)");
  EXPECT_SAYS("MFEM NC mesh v1.0\n", "hanging nodes");
  EXPECT_SAYS("MFEM INLINE mesh v1.0\n", "save the mesh that MFEM makes");
  EXPECT_SAYS("MFEM mesh v2.0\n", "1.0 to 1.3");
  EXPECT_SAYS("MFEM mesh v1.0\ndimension\n1\n", "dimension 1");
  EXPECT_SAYS("MFEM mesh v1.1\n" + kHead.substr(15) + kElements + "vertex_parents\n1\n3 0 1\n", "hanging nodes");
  EXPECT_SAYS("MFEM mesh v1.2\n" + kHead.substr(15) + kElements + kVertices + "\ncommunication_groups\n", "SaveAsOne");
  EXPECT_SAYS(kHead + kElements + nodes("NURBS2", 4), "cannot read nodes in the space 'NURBS2'");
  EXPECT_SAYS(kHead + kElements + nodes("H1_2D_P11", 4), "order 11");
}

TEST(MfemErrors, Gaps) {
  // One vertex of the second triangle is elsewhere, so the mesh is not periodic either.
  const std::string own =
      "vertices\n4\n\nnodes\nFiniteElementSpace\nFiniteElementCollection: L2_T1_2D_P1\nVDim: 2\n"
      "Ordering: 1\n\n0 0\n1 0\n0 1\n1 0\n1 1\n5 1\n";
  EXPECT_SAYS(kHead + kElements + own, "it has gaps");
  EXPECT_SAYS(kHead + kElements + own, "element 2");
}

TEST(MfemErrors, WrongIndices) {
  EXPECT_SAYS(kHead + "elements\n1\n1 2 0 1 4\nboundary\n0\n" + kVertices, "element 1 ");
  EXPECT_SAYS(kHead + "elements\n1\n1 2 0 1 4\nboundary\n0\n" + kVertices,
              "refers to vertex 4, but the vertices are 0 to 3");
  EXPECT_SAYS(kHead + "elements\n1\n1 2 0 1 -4\nboundary\n0\n" + kVertices, "refers to vertex -4");
  EXPECT_SAYS(kHead + "elements\n1\n1 9 0 1 2\n", "geometry type 9");
  EXPECT_SAYS(kHead + "elements\n1\n1 5 0 1 2\n", "does not have dimension 2");
  EXPECT_SAYS(kHead + "elements\n1\n0 2 0 1 2\n", "attribute 0");
  EXPECT_SAYS(kHead + "elements\n1\n1 2 0 1 2\nboundary\n1\n1 1 0 3\n" + nodes("H1_2D_P2", 9), "is on no element");
}

TEST(MfemErrors, WrongCounts) {
  EXPECT_SAYS(kHead + "elements\n3\n1 2 0 1 2\n1 2 1 3 2\n\nboundary\n",
              "an element's attribute was expected, found 'boundary'");
  EXPECT_SAYS(kHead + "elements\n3\n1 2 0 1 2\n1 2 1 3 2\n\nboundary\n", "line 12");
  EXPECT_SAYS(kHead + "elements\n1\n1 2 0 1 2\n1 2 1 3 2\n\nboundary\n0\n", "'boundary' was expected");
  EXPECT_SAYS(kHead + "elements\n-1\n", "negative");
  EXPECT_SAYS(kHead + "elements\n99999999999\n", "exceeds 2147483647");
  EXPECT_SAYS(kHead + kElements + "vertices\n3\n2\n0 0\n1 0\n0 1\n", "refers to vertex 3");
  EXPECT_SAYS(kHead + kElements + kVertices + "7 7\n", "something follows the last number");
  EXPECT_SAYS(kHead + kElements + nodes("H1_2D_P2", 8), "ends at byte");
  EXPECT_SAYS(kHead + kElements + nodes("H1_2D_P2", 10), "something follows the last number");
}

TEST(MfemErrors, WordsWhereNumbersBelong) {
  EXPECT_SAYS(kHead + kElements + "vertices\n4\n2\n0 zero\n",
              "a vertex's coordinate was expected, found 'zero' (line 19");
}

// === Damaged files =======================================================================================

std::vector<std::string> sound_files() {
  std::vector<std::string> files{kHead + kElements + kVertices};
  for (const char* space : {"H1_3D_P3", "L2_T2_3D_P3"}) {
    HighOrderMesh mesh = testing::grid(testing::Filling::Prisms, {1, 1, 1}, 3);
    formats::remember_mfem_nodes(mesh, {*formats::mfem_space(space), 3, true});
    files.push_back(test::written(mesh, Format::Mfem));
  }
  files.push_back(test::written(testing::grid(testing::Filling::Pyramids, {1, 1, 1}, 3), Format::Mfem));
  return files;
}

TEST(DamagedMfemFile, IsRefusedWhereverItIsCutShort) {
  for (const std::string& whole : sound_files()) {
    ASSERT_EQ(testing::why_not(whole), "it was read");
    for (std::size_t k = 0; k < 200; ++k) {
      const std::string cut = whole.substr(0, k * whole.size() / 200);
      if (cut.size() + 1 == whole.size()) continue;  // without the end of the last line
      EXPECT_FALSE(formats::read(cut)) << "cut at byte " << cut.size();
      EXPECT_GT(testing::why_not(cut).size(), 20U);
    }
  }
}

TEST(DamagedMfemFile, IsReadOrRefusedWithFlippedBytes) {
  for (const std::string& whole : sound_files()) testing::expect_survives_flips(whole, 500);
}

}  // namespace
}  // namespace varimesh
