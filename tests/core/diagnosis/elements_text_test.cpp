// Elements in words.
#include "core/diagnosis/elements_text.h"

#include <gtest/gtest.h>

#include <numeric>

namespace varimesh {
namespace {

std::string text(const std::vector<std::int64_t>& elements) {
  return elements_text(elements, "tetrahedron", "tetrahedra");
}

TEST(ElementsText, NamesEveryElementOfAFew) {
  EXPECT_EQ(text({4711}), "tetrahedron 4711");
  EXPECT_EQ(text({1, 2}), "tetrahedra 1 and 2");
  EXPECT_EQ(text({1, 2, 3}), "tetrahedra 1, 2 and 3");
  EXPECT_EQ(text({1, 2, 3, 4, 5, 6, 7, 8}), "tetrahedra 1, 2, 3, 4, 5, 6, 7 and 8");
}

TEST(ElementsText, CountsTheRestOfMany) {
  std::vector<std::int64_t> many(28);
  std::iota(many.begin(), many.end(), 1);
  EXPECT_EQ(text(many), "tetrahedra 1, 2, 3, 4, 5, 6, 7, 8 and 20 more");
}

}  // namespace
}  // namespace varimesh
