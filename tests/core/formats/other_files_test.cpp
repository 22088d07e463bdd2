// Files of other programs are recognised, and older MSH versions are read.
#include <gtest/gtest.h>

#include <array>
#include <cstring>

#include "core/geometry/cad/file_kind.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;

std::string why_not(const std::string& bytes) {
  const auto mesh = formats::read(bytes);
  return mesh ? "it was read" : mesh.error().sentence;
}

TEST(OtherFiles, AreRecognisedAndTheSentenceSaysWhatToRun) {
  std::string stl(84 + 2 * 50, ' ');
  const std::uint32_t triangles = 2;
  std::memcpy(stl.data() + 80, &triangles, 4);
  const std::array<std::array<std::string, 3>, 16> files{{
      {"ISO-10303-21;\nHEADER;\n", "a STEP file", "gmsh FILE -3"},
      {"\xef\xbb\xbf\r\n ISO-10303-21;\r\nHEADER;\r\n", "a STEP file", "gmsh FILE -3"},
      {std::string(72, ' ') + "S      1\r\n", "an IGES file", "gmsh FILE -3"},
      {"\nOpen CASCADE Topology V1 (c)\n", "a BREP file", "gmsh FILE -3"},
      {"DBRep_DrawableShape\n\nCASCADE Topology V1", "a BREP file", "gmsh FILE -3"},
      {"# vtk DataFile Version 3.0\n", "a VTK file", "meshio convert FILE"},
      {"solid cube\nfacet normal 0 0 1\n", "an STL file", "tutorial t13"},
      {stl, "an STL file", "tutorial t13"},
      {"# Blender\n\no Cube\nv 1 1 1\n", "an OBJ file", "meshio convert FILE surface.stl"},
      {"v 1 1 1\n", "an OBJ file", "meshio convert FILE surface.stl"},
      {"NDIME= 2\n", "an SU2 mesh", "gmsh FILE -save"},
      {"$ Created by Gmsh\nGRID,1,0,0.,0.,0.\n", "a Nastran file", "gmsh FILE -save"},
      {"BEGIN BULK\n", "a Nastran file", "gmsh FILE -save"},
      {"    -1\n  2411\n", "UNV", "gmsh FILE -save"},
      {"24 13 5\n0 1\n", "does not begin with a section", "meshio convert FILE"},
      {"\x1f\x8b\b", "a compressed file", "gunzip FILE"},
  }};
  for (const auto& [bytes, is, run] : files) {
    EXPECT_NE(why_not(bytes).find(is), std::string::npos) << why_not(bytes);
    EXPECT_NE(why_not(bytes).find(run), std::string::npos) << why_not(bytes);
  }
}

TEST(OtherFiles, AMeshThatNamesACadFileIsStillAMesh) {
  const std::string triangle = "*node\n1, 0, 0\n2, 1, 0\n3, 0, 1\n*element, type=CPS3\n1, 1, 2, 3\n";
  const std::string title = "** " + std::string(69, '-');  // up to column 72
  for (const std::string& first : {std::string("** made from ISO-10303-21, DBRep_DrawableShape, Open CASCADE Topology"),
                                   title + "Surfaces", title + "S       ", title + "S 1", title + "S12345x7"}) {
    const auto file = formats::read(first + "\n" + triangle);
    ASSERT_TRUE(file) << first << ": " << file.error().sentence;
    EXPECT_EQ(geometry::kind_of_cad_file(first + "\n" + triangle), geometry::CadFileKind::Unknown) << first;
  }
}

TEST(OtherFiles, TextsMayBeginWithTheMarkOfUtf8) {
  const std::string triangle = "*node\r\n1, 0, 0\r\n2, 1, 0\r\n3, 0, 1\r\n*element, type=CPS3\r\n1, 1, 2, 3\r\n";
  for (const std::string& begin : {std::string(), std::string("\xef\xbb\xbf")}) {
    const auto file = formats::read(begin + triangle);
    ASSERT_TRUE(file) << file.error().sentence;
    EXPECT_EQ(file->format, formats::Format::Abaqus);
    EXPECT_EQ(file->mesh.node_count(), 3U);
  }
}

const std::string kNodes = "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 1 1 0\n$EndNodes\n";

TEST(OldVersions, Msh20HasNamesWithoutDimensionsAndOnePartitionPerElement) {
  const std::string text =
      "$MeshFormat\n2.0 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n5 \"wing\"\n6 \"flow\"\n$EndPhysicalNames\n" + kNodes +
      "$Elements\n3\n1 1 3 5 1 2 1 2\n2 2 3 6 1 2 1 2 3\n3 2 3 6 1 3 2 4 3\n$EndElements\n";
  const auto mesh = formats::read(text);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  EXPECT_EQ(mesh->format, Format::Msh22);
  ASSERT_EQ(mesh->mesh.physical_groups.size(), 2U);
  EXPECT_EQ(mesh->mesh.physical_groups[0].dimension, 1);
  EXPECT_EQ(mesh->mesh.physical_groups[1].dimension, 2);
  ASSERT_EQ(mesh->mesh.blocks.size(), 3U);
  EXPECT_EQ(mesh->mesh.blocks[1].partitions, std::vector<int>{2});
  EXPECT_EQ(mesh->mesh.blocks[2].partitions, std::vector<int>{3});
}

TEST(OldVersions, Msh21IsReadLikeMsh22) {
  const std::string after = "$PhysicalNames\n1\n2 6 \"flow\"\n$EndPhysicalNames\n" + kNodes +
                            "$Elements\n2\n2 2 2 6 1 1 2 3\n3 2 2 6 1 2 4 3\n$EndElements\n";
  const auto old = formats::read("$MeshFormat\n2.1 0 8\n$EndMeshFormat\n" + after);
  const auto now = formats::read("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n" + after);
  ASSERT_TRUE(old && now);
  EXPECT_EQ(old->mesh.coordinates, now->mesh.coordinates);
  EXPECT_EQ(old->mesh.blocks[0].nodes, now->mesh.blocks[0].nodes);
  EXPECT_EQ(old->mesh.physical_groups[0].name, "flow");
}

// The layout is that of a file of version 4.0 which Gmsh 4.8 wrote: points have boxes, blocks name the entity before
// the dimension, and each node has its number in its line.
const std::string kEntities40 =
    "$Entities\n1 1 1 0\n1 0 0 0 0 0 0 0 \n1 0 0 0 1 0 0 1 5 2 1 -1 \n1 0 0 0 1 1 0 1 6 1 1 \n$EndEntities\n";

TEST(OldVersions, Msh40IsRead) {
  const std::string text =
      "$MeshFormat\n4 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 5 \"wing\"\n2 6 \"flow\"\n$EndPhysicalNames\n" +
      kEntities40 +
      "$Nodes\n2 4\n1 1 1 2\n1 0 0 0 0.25\n2 1 0 0 0.75\n1 2 0 2\n3 0 1 0\n4 1 1 0\n$EndNodes\n"
      "$Elements\n2 3\n1 1 1 1\n1 1 2\n1 2 2 2\n2 1 2 3\n3 2 4 3\n$EndElements\n"
      "$Periodic\n1\n0 1 1\nAffine 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1\n1\n2 1\n$EndPeriodic\n";
  const auto mesh = formats::read(text);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  EXPECT_EQ(mesh->format, Format::Msh41);
  EXPECT_EQ(mesh->mesh.coordinates, (std::vector<double>{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}));
  ASSERT_EQ(mesh->mesh.blocks.size(), 2U);
  EXPECT_EQ(mesh->mesh.blocks[0].physical, std::vector<int>{5});
  EXPECT_EQ(mesh->mesh.blocks[1].physical, std::vector<int>{6});
  EXPECT_EQ(mesh->mesh.blocks[1].nodes, (std::vector<std::int32_t>{0, 1, 2, 1, 3, 2}));
  ASSERT_EQ(mesh->mesh.periodic.size(), 1U);
  EXPECT_EQ(mesh->mesh.periodic[0].affine.size(), 16U);
  // Written as 4.1, it is the same mesh.
  std::string written;
  ASSERT_TRUE(formats::write(mesh->mesh, mesh->format, [&](std::string_view piece) {
    written += piece;
    return true;
  }));
  const auto again = formats::read(written);
  ASSERT_TRUE(again) << again.error().sentence;
  EXPECT_EQ(again->mesh.blocks[1].nodes, mesh->mesh.blocks[1].nodes);
  EXPECT_EQ(again->mesh.entities[0].box, mesh->mesh.entities[0].box);
}

TEST(OldVersions, Msh40IsReadInBinary) {
  std::string bytes;
  const auto put = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  const auto ints = [&](std::initializer_list<std::int32_t> values) {
    for (const auto value : values) put(value);
  };
  bytes = "$MeshFormat\n4 1 8\n";
  put(std::int32_t{1});
  bytes += "\n$EndMeshFormat\n$Nodes\n";
  put(std::uint64_t{1}), put(std::uint64_t{3});
  ints({1, 2, 0}), put(std::uint64_t{3});
  const double places[3][2] = {{0, 0}, {1, 0}, {0, 1}};
  for (int i = 0; i < 3; ++i) {
    ints({i + 1});
    put(places[i][0]), put(places[i][1]), put(0.0);
  }
  bytes += "\n$EndNodes\n$Elements\n";
  put(std::uint64_t{1}), put(std::uint64_t{1});
  ints({1, 2, 2}), put(std::uint64_t{1});
  ints({7, 1, 2, 3});
  bytes += "\n$EndElements\n";
  const auto mesh = formats::read(bytes);
  ASSERT_TRUE(mesh) << mesh.error().sentence;
  EXPECT_EQ(mesh->format, Format::Msh41Binary);
  EXPECT_EQ(mesh->mesh.blocks[0].numbers, std::vector<std::int64_t>{7});
  EXPECT_EQ(mesh->mesh.coordinates[3], 1);
}

TEST(OldVersions, WhatIsNotReadOfMsh40IsSaid) {
  const std::string head = "$MeshFormat\n4 0 8\n$EndMeshFormat\n";
  EXPECT_NE(why_not(head + "$PartitionedEntities\n1\n$EndPartitionedEntities\n").find("write"), std::string::npos);
  EXPECT_NE(why_not(head + "$Nodes\n1 1\n1 4 0 1\n1 0 0 0\n$EndNodes\n").find("dimension must be 0 to 3"),
            std::string::npos);
  EXPECT_NE(why_not("$NOD\n1\n$ENDNOD\n").find("MSH version 1 is not supported"), std::string::npos);
}

}  // namespace
}  // namespace varimesh
