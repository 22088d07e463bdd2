#include "core/base/counted.h"

#include <gtest/gtest.h>

namespace varimesh {
namespace {

TEST(Counted, KnowsOneFromMany) {
  EXPECT_EQ(counted(1, "element"), "1 element");
  EXPECT_EQ(counted(0, "element"), "0 elements");
  EXPECT_EQ(counted(12, "element"), "12 elements");
  EXPECT_EQ(counted(1, "body", "bodies"), "1 body");
  EXPECT_EQ(counted(2, "body", "bodies"), "2 bodies");
}

}  // namespace
}  // namespace varimesh
