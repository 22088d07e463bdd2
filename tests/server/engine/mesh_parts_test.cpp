// Meshes as sequences of MeshPart messages.
#include "server/engine/mesh_parts.h"

#include <gtest/gtest.h>

#include "varimesh/v1/mesh.pb.h"

namespace varimesh::server {
namespace {

HighOrderMesh two_triangles() {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  mesh.coordinates = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  mesh.node_numbers = {1, 2, 3, 4};
  mesh.node_blocks = {{-1, 0, 0, 4}};
  ElementBlock block;
  block.shape = Shape::Triangle;
  block.order = 1;
  block.entity = 7;
  block.physical = {3};
  block.numbers = {1, 2};
  block.nodes = {0, 1, 2, 0, 2, 3};
  mesh.blocks = {block};
  mesh.physical_groups = {{2, 3, "sheet"}};
  return mesh;
}

std::string parts_of(const HighOrderMesh& mesh) {
  std::string bytes;
  const auto written = write_mesh_parts(mesh, [&](std::string_view piece) {
    bytes += piece;
    return true;
  });
  EXPECT_TRUE(written);
  return bytes;
}

TEST(MeshParts, RefuseANameThatIsNotUtf8) {
  HighOrderMesh mesh = two_triangles();
  mesh.physical_groups = {{2, 3,
                           "Fl\xe4"
                           "che"}};
  const auto written = write_mesh_parts(mesh, [](std::string_view) { return true; });
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().sentence.find("dimension 2 and tag 3"), std::string::npos) << written.error().sentence;
}

TEST(MeshParts, PreserveAMesh) {
  const HighOrderMesh mesh = two_triangles();
  const auto back = read_mesh_parts(parts_of(mesh));
  ASSERT_TRUE(back) << back.error().sentence;
  EXPECT_EQ(back->coordinates, mesh.coordinates);
  ASSERT_EQ(back->blocks.size(), 1u);
  EXPECT_EQ(back->blocks[0].nodes, mesh.blocks[0].nodes);
  EXPECT_EQ(back->blocks[0].physical, mesh.blocks[0].physical);
  EXPECT_EQ(back->blocks[0].entity, 7);
  EXPECT_EQ(back->physical_groups[0].name, "sheet");
}

TEST(MeshParts, JoinPartsOfOneKindAndDropEmptyOnes) {
  HighOrderMesh mesh = two_triangles();
  ElementBlock half = mesh.blocks[0];
  half.nodes.resize(3);
  half.numbers.resize(1);
  ElementBlock other = half;
  other.physical = {4};
  mesh.blocks = {half, half, other, half};
  v1::MeshPart empty;
  empty.mutable_elements()->set_shape(v1::SHAPE_TRIANGLE);
  const std::string nothing = empty.SerializeAsString();
  const auto back = read_mesh_parts(parts_of(mesh) + static_cast<char>(nothing.size()) + nothing);
  ASSERT_TRUE(back) << back.error().sentence;
  ASSERT_EQ(back->blocks.size(), 3u);
  EXPECT_EQ(back->blocks[0].numbers, (std::vector<std::int64_t>{1, 2}));
  EXPECT_EQ(back->blocks[0].nodes, (std::vector<std::int32_t>{0, 1, 2, 0, 1, 2}));
  EXPECT_EQ(back->blocks[1].physical, std::vector<int>{4});
  EXPECT_EQ(back->blocks[2].numbers, std::vector<std::int64_t>{4});
}

TEST(MeshParts, ReportWhereTheyAreCutOff) {
  const std::string bytes = parts_of(two_triangles());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto back = read_mesh_parts(std::string_view(bytes).substr(0, size));
    if (back) continue;  // all remaining parts are complete, and they make a mesh
    EXPECT_EQ(back.error().kind, Error::Kind::BadInput);
    EXPECT_FALSE(back.error().sentence.empty());
  }
  const auto cut = read_mesh_parts(std::string_view(bytes).substr(0, 20));
  ASSERT_FALSE(cut);
  EXPECT_NE(cut.error().sentence.find("at byte"), std::string::npos) << cut.error().sentence;
}

TEST(MeshParts, RefuseANodeThatDoesNotExist) {
  HighOrderMesh mesh = two_triangles();
  mesh.blocks[0].nodes[5] = 4;
  const auto back = read_mesh_parts(parts_of(mesh));
  ASSERT_FALSE(back);
  EXPECT_NE(back.error().sentence.find("node 4"), std::string::npos);
}

}  // namespace
}  // namespace varimesh::server
