#include "core/mesh/node_parameters.h"

#include <gtest/gtest.h>

namespace varimesh {
namespace {

HighOrderMesh three_blocks() {
  HighOrderMesh mesh;
  mesh.coordinates.assign(18, 0.5);
  mesh.node_blocks = {{1, 1, 0, 2, {0, 1}}, {2, 1, 2, 2, {0, 0, 1, 1}}, {3, 1, 4, 2}};
  return mesh;
}

TEST(NodeParameters, AreForgottenForBlocksOfWhichANodeHasMoved) {
  HighOrderMesh mesh = three_blocks();
  const NodesWithParameters before(mesh);
  before.forget_moved(mesh);
  EXPECT_TRUE(has_parameters(mesh.node_blocks[0]));
  EXPECT_TRUE(has_parameters(mesh.node_blocks[1]));
  mesh.coordinates[3 * 4] = 7;  // in the volume, which has none
  mesh.coordinates[3 * 3 + 1] = 7;
  before.forget_moved(mesh);
  EXPECT_TRUE(has_parameters(mesh.node_blocks[0]));
  EXPECT_TRUE(mesh.node_blocks[1].parameters.empty());
}

TEST(NodeParameters, AreForgottenForBlocksThatNodesWereAddedTo) {
  HighOrderMesh mesh = three_blocks();
  const NodesWithParameters before(mesh);
  mesh.coordinates.resize(21);
  mesh.node_blocks[1].count = 3;
  EXPECT_FALSE(has_parameters(mesh.node_blocks[1]));
  before.forget_moved(mesh);
  EXPECT_TRUE(mesh.node_blocks[1].parameters.empty());
}

}  // namespace
}  // namespace varimesh
