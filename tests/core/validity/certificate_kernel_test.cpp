// The vectorised coefficients against wider arithmetic.
#include "core/validity/certificate_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/validity/rounding.h"
#include "tests/core/support/bernstein_cells.h"

namespace varimesh::detail {
namespace {

class CertificateKernel : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Shapes, CertificateKernel, ::testing::ValuesIn(testing::kCellShapes),
                         [](const auto& shape) { return testing::name(shape.param); });

TEST_P(CertificateKernel, IsWithinTheErrorItStates) {
  const Shape shape = GetParam();
  for (int order = 1; order <= 6; ++order) {
    const HighOrderMesh mesh =
        testing::shaken_cells(shape, order, 3, 0.2 / std::pow(order, 4), static_cast<unsigned>(10 + order));
    KernelInput input;
    input.table = &jacobian_table(shape, order);
    input.coordinates = mesh.coordinates.data();
    for (std::size_t cell = 0; cell < 3 && cell < kernel_lanes(); ++cell)
      input.nodes[input.cells++] = hard_cell(mesh, cell).nodes;
    KernelOutput output;
    std::vector<double> workspace;
    bernstein_kernel(input, workspace, output);
    for (std::size_t lane = 0; lane < input.cells; ++lane) {
      const Coefficients<long double> exact = extended_coefficients(hard_cell(mesh, lane));
      const auto [least, greatest] = std::ranges::minmax(exact.values);
      const double allowed = output.error[lane] + static_cast<double>(exact.error);
      EXPECT_LE(std::abs(output.least[lane] - static_cast<double>(least)), allowed);
      EXPECT_LE(std::abs(output.greatest[lane] - static_cast<double>(greatest)), allowed);
      EXPECT_LT(output.error[lane], (order <= 4 ? 1e-7 : 1e-3) * static_cast<double>(greatest)) << "order " << order;
      EXPECT_LT(static_cast<double>(exact.error), 1e-10 * static_cast<double>(greatest)) << "order " << order;
      for (std::size_t k = 0; k < input.table->corners.size(); ++k)
        EXPECT_NEAR(output.corner[k][lane], static_cast<double>(exact.values[input.table->corners[k]]), allowed);
      ASSERT_EQ(exact.values.size(), static_cast<std::size_t>(input.table->jacobian.size()));
      for (std::size_t k = 0; k < exact.values.size(); ++k)
        EXPECT_NEAR(output.coefficients[k * kernel_lanes() + lane], static_cast<double>(exact.values[k]), allowed);
    }
  }
}

TEST(RoundingError, IsALittleMoreThanThatManyRoundings) {
  constexpr double u = 0x1p-53;
  EXPECT_EQ(relative_rounding(0, u), 0);
  EXPECT_GE(relative_rounding(1, u), u);
  EXPECT_GT(relative_rounding(1000, u), 1000 * u);
  EXPECT_LT(relative_rounding(1000, u), 1000 * u * (1 + 1e-12));
}

}  // namespace
}  // namespace varimesh::detail
