#include "client/report/snapshots.h"

#include <gtest/gtest.h>

#include "core/formats/formats.h"

namespace varimesh::client {
namespace {

/// A square of side 2 as two linear triangles with these numbers; the node (2, 2) is moved to (x, y).
std::shared_ptr<const HighOrderMesh> square(int first, int second, double x = 2, double y = 2) {
  const std::string text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 2 0 0\n3 0 2 0\n4 " +
                           std::to_string(x) + " " + std::to_string(y) + " 0\n$EndNodes\n$Elements\n2\n" +
                           std::to_string(first) + " 2 2 1 1 1 2 3\n" + std::to_string(second) +
                           " 2 2 1 1 2 4 3\n$EndElements\n";
  auto file = formats::read(text);
  EXPECT_TRUE(file) << (file ? "" : file.error().sentence);
  return std::make_shared<const HighOrderMesh>(std::move(file->mesh));
}

TEST(Snapshots, OneMeshIsBefore) {
  const auto snapshots = Snapshots::create(square(1, 2), nullptr);
  ASSERT_TRUE(snapshots);
  EXPECT_EQ(snapshots->count(), 1U);
  EXPECT_STREQ(Snapshots::name(0), "before");
  EXPECT_STREQ(Snapshots::name(1), "after");
}

TEST(Snapshots, CellsAreMatchedByTheirNumbers) {
  const auto before = square(7, 8);
  auto swapped = std::make_shared<HighOrderMesh>(*square(7, 8, 3, 3));
  // The cells of the second mesh have their numbers the other way round.
  for (ElementBlock& block : swapped->blocks)
    for (std::int64_t& number : block.numbers) number = 15 - number;
  const auto snapshots = Snapshots::create(before, swapped);
  ASSERT_TRUE(snapshots);
  EXPECT_EQ((*snapshots)[1].order, (std::vector<std::int32_t>{1, 0}));
  EXPECT_EQ(snapshots->point(0, 1, 1), (std::array<double, 3>{2, 2, 0}));
  EXPECT_EQ(snapshots->point(1, 0, 1), (std::array<double, 3>{3, 3, 0}));
}

TEST(Snapshots, OtherElementsAreRefused) { EXPECT_FALSE(Snapshots::create(square(1, 2), square(1, 3))); }

TEST(Snapshots, KnowWhereCellsAreAndHowLarge) {
  const auto snapshots = Snapshots::create(square(1, 2), nullptr);
  ASSERT_TRUE(snapshots);
  EXPECT_EQ(snapshots->box(), (std::array<double, 6>{0, 0, 0, 2, 2, 0}));
  EXPECT_EQ(snapshots->centre(), (std::array<double, 3>{1, 1, 0}));
  const auto middle = snapshots->middle(0, 1);
  EXPECT_NEAR(middle[0], 4.0 / 3, 1e-12);
  EXPECT_NEAR(middle[1], 4.0 / 3, 1e-12);
  EXPECT_EQ(snapshots->size(0, 0), 2);
}

TEST(Snapshots, NodesThatNoCellUsesAreNotInTheBox) {
  auto mesh = std::make_shared<HighOrderMesh>(*square(1, 2));
  mesh->coordinates.insert(mesh->coordinates.end(), {1e5, 1e5, 0});
  mesh->node_numbers.push_back(5);
  ++mesh->node_blocks.back().count;
  const auto snapshots = Snapshots::create(mesh, nullptr);
  ASSERT_TRUE(snapshots);
  EXPECT_EQ(snapshots->box(), (std::array<double, 6>{0, 0, 0, 2, 2, 0}));
}

TEST(Snapshots, TheWorstCellComesFirst) {
  // With its node beyond the diagonal, the second triangle is inverted.
  const auto snapshots = Snapshots::create(square(1, 2, 0.5, 0.5), nullptr);
  ASSERT_TRUE(snapshots);
  EXPECT_EQ(snapshots->worst(0, 10), (std::vector<std::int32_t>{1, 0}));
  EXPECT_EQ(snapshots->worst(0, 1), std::vector<std::int32_t>{1});
  EXPECT_LT((*snapshots)[0].scaled_jacobian[1], 0);
}

}  // namespace
}  // namespace varimesh::client
