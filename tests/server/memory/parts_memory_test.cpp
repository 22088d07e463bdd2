// Parts of meshes that are too many and too small: what reading them takes stays within formats::most_memory_to_read().
#include <gtest/gtest.h>

#include "server/engine/mesh_parts.h"
#include "tests/core/memory/counted_heap.h"
#include "varimesh/v1/mesh.pb.h"

namespace varimesh::server {
namespace {

void add(std::string& bytes, const v1::MeshPart& part) {
  const std::string one = part.SerializeAsString();
  ASSERT_LT(one.size(), 128u) << "the length must fit into a byte";
  bytes += static_cast<char>(one.size());
  bytes += one;
}

/// A header of a mesh of three nodes, and their coordinates.
std::string beginning() {
  std::string bytes;
  v1::MeshPart part;
  part.mutable_header()->set_dimension(2);
  part.mutable_header()->set_order(1);
  part.mutable_header()->set_nodes(3);
  part.mutable_header()->set_node_set(v1::NODE_SET_EQUISPACED);
  add(bytes, part);
  for (const double x : {0, 0, 0, 1, 0, 0, 0, 1, 0}) part.mutable_coordinates()->add_xyz(x);
  add(bytes, part);
  return bytes;
}

v1::MeshPart elements(v1::Shape shape, std::vector<int> nodes, int entity) {
  v1::MeshPart part;
  part.mutable_elements()->set_shape(shape);
  part.mutable_elements()->set_entity(entity);
  part.mutable_elements()->mutable_nodes()->Assign(nodes.begin(), nodes.end());
  return part;
}

/// Reads the parts and returns what came of it: "read", or why not.
std::string read_within_bounds(const std::string& bytes) {
  const std::int64_t before = varimesh::testing::bytes_in_use();
  varimesh::testing::forget_peak();
  std::string outcome = "read";
  {
    const auto mesh = read_mesh_parts(bytes);
    if (!mesh) outcome = mesh.error().sentence;
  }
  const std::int64_t peak = varimesh::testing::peak_bytes() - before;
  EXPECT_LE(peak, formats::most_memory_to_read(static_cast<std::int64_t>(bytes.size()))) << outcome;
  return outcome;
}

TEST(MemoryOfParts, IsBoundedForEmptyParts) {
  std::string bytes = beginning();
  const v1::MeshPart empty = elements(v1::SHAPE_TRIANGLE, {}, 1);
  for (int i = 0; i < 4'000'000; ++i) add(bytes, empty);
  EXPECT_EQ(read_within_bounds(bytes), "read");
}

TEST(MemoryOfParts, IsBoundedForPartsOfOneElement) {
  std::string bytes = beginning();
  const v1::MeshPart parts[] = {elements(v1::SHAPE_TRIANGLE, {0, 1, 2}, 1), elements(v1::SHAPE_TRIANGLE, {0, 1, 2}, 2)};
  for (int i = 0; i < 1'000'000; ++i) add(bytes, parts[i % 2]);
  EXPECT_NE(read_within_bounds(bytes).find("send more elements in each part"), std::string::npos);
}

TEST(MemoryOfParts, IsBoundedForElementsOfOneByte) {
  std::string bytes = beginning();
  const v1::MeshPart points = elements(v1::SHAPE_POINT, std::vector<int>(100, 1), 1);
  for (int i = 0; i < 100'000; ++i) add(bytes, points);
  EXPECT_NE(read_within_bounds(bytes).find("takes more memory"), std::string::npos);
}

TEST(MemoryOfParts, IsBoundedForGroups) {
  std::string bytes = beginning();
  v1::MeshPart part;
  part.mutable_physical_group()->set_tag(1);
  for (int i = 0; i < 2'000'000; ++i) add(bytes, part);
  EXPECT_NE(read_within_bounds(bytes).find("takes more memory"), std::string::npos);
}

TEST(MemoryOfParts, IsBoundedForAHeaderThatAnnouncesTooMuch) {
  v1::MeshPart part;
  part.mutable_header()->set_dimension(2);
  part.mutable_header()->set_order(1);
  part.mutable_header()->set_nodes(2147483647);
  part.mutable_header()->set_node_set(v1::NODE_SET_EQUISPACED);
  std::string bytes;
  add(bytes, part);
  EXPECT_NE(read_within_bounds(bytes).find("2147483647 nodes"), std::string::npos);
}

}  // namespace
}  // namespace varimesh::server
