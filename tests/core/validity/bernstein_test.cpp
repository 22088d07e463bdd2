// The tables behind the certificate: spaces of polynomials, products and corners.
#include "core/validity/bernstein.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/core/support/made_cells.h"

namespace varimesh::detail {
namespace {

class BernsteinTables : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Shapes, BernsteinTables, ::testing::ValuesIn(testing::kCellShapes),
                         [](const auto& shape) { return testing::name(shape.param); });

TEST(BernsteinSpace, CountsTheMonomialsOfItsFactors) {
  EXPECT_EQ(BernsteinSpace({{2, 3}}).size(), 10) << "cubics on a triangle";
  EXPECT_EQ(BernsteinSpace({{3, 2}}).size(), 10) << "quadratics on a tetrahedron";
  EXPECT_EQ(BernsteinSpace({{1, 2}, {1, 3}}).size(), 12) << "2 by 3 on a quadrilateral";
  EXPECT_EQ(BernsteinSpace({{2, 1}, {1, 1}}).size(), 6) << "linear on a prism";
}

TEST(BernsteinSpace, FindsEveryMonomialByItsExponents) {
  const BernsteinSpace space({{2, 3}, {1, 2}});
  EXPECT_EQ(space.offset(0), 0);
  EXPECT_EQ(space.offset(1), 3);
  for (int k = 0; k < space.size(); ++k) {
    const Exponents& e = space.exponents()[static_cast<std::size_t>(k)];
    EXPECT_EQ(e[0] + e[1] + e[2], 3);
    EXPECT_EQ(e[3] + e[4], 2);
    EXPECT_EQ(space.index(e), k);
  }
}

TEST(BernsteinSpace, MultipliesTheMultinomialsOfItsFactors) {
  const BernsteinSpace space({{2, 3}, {1, 2}});
  EXPECT_EQ(space.multinomial(space.index({3, 0, 0, 2, 0, 0})), 1);
  EXPECT_EQ(space.multinomial(space.index({1, 1, 1, 1, 1, 0})), 6 * 2);
  EXPECT_EQ(space.multinomial(space.index({2, 1, 0, 0, 2, 0})), 3);
}

TEST_P(BernsteinTables, HaveACornerForEveryVertexOfTheProduct) {
  const int corners = GetParam() == Shape::Pyramid ? 8 : reference::info(GetParam()).vertices;
  for (int order = 2; order <= 4; ++order) {  // at order 1, J of a simplex is constant
    const JacobianTable& table = jacobian_table(GetParam(), order);
    EXPECT_EQ(static_cast<int>(table.corners.size()), corners);
    ASSERT_EQ(table.corner_at.size(), table.corners.size());
    for (std::size_t c = 0; c < table.corners.size(); ++c) {
      // At a corner one barycentric coordinate of each factor is 1. Only this coordinate has an exponent.
      const Exponents& e = table.jacobian.exponents()[table.corners[c]];
      for (std::size_t slot = 0; slot < 6; ++slot)
        EXPECT_TRUE(table.corner_at[c][slot] == 1 || (table.corner_at[c][slot] == 0 && e[slot] == 0));
      EXPECT_EQ(table.jacobian.multinomial(table.corners[c]), 1);
    }
  }
}

TEST_P(BernsteinTables, DegreesAreTheKnownOnes) {
  const int coefficients[6][5] = {{6, 15, 28, 45, 66},        {16, 36, 64, 100, 144},
                                  {20, 84, 220, 455, 816},    {144, 567, 1440, 2925, 5184},
                                  {90, 324, 792, 1575, 2754}, {216, 729, 1728, 3375, 5832}};
  for (int order = 2; order <= 6; ++order)
    EXPECT_EQ(jacobian_table(GetParam(), order).jacobian.size(),
              coefficients[static_cast<int>(GetParam()) - static_cast<int>(Shape::Triangle)][order - 2]);
}

}  // namespace
}  // namespace varimesh::detail
