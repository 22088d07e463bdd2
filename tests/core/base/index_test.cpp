// Where the entries of packed symmetric matrices are.
#include "core/base/index.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace varimesh {
namespace {

TEST(LowerIndex, CountsTheLowerTriangleByRows) {
  int next = 0;
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j <= i; ++j) EXPECT_EQ(lower_index(i, j), next++) << i << " " << j;
}

TEST(SymmetricIndex, IsTheSameInEitherOrder) {
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j <= i; ++j) {
      EXPECT_EQ(symmetric_index(i, j), lower_index(i, j));
      EXPECT_EQ(symmetric_index(j, i), lower_index(i, j));
    }
}

TEST(TriangleSize, IsOneBehindTheLastIndex) {
  for (int rows = 1; rows < 10; ++rows) EXPECT_EQ(triangle_size(rows), lower_index(rows - 1, rows - 1) + 1);
  EXPECT_EQ(triangle_size(0), 0);
  EXPECT_EQ(triangle_size(3), 6);
}

TEST(At, KeepsTheNumber) {
  EXPECT_EQ(at(std::int8_t{7}), 7U);
  EXPECT_EQ(at(std::int32_t{2147483647}), 2147483647U);
  EXPECT_EQ(at(std::int64_t{1} << 40), std::size_t{1} << 40);
}

}  // namespace
}  // namespace varimesh
