// The tables behind the certificate, against the bases of core/reference and against wider arithmetic.
#include "core/validity/bernstein.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/reference/basis.h"
#include "core/validity/cell_coefficients.h"
#include "core/validity/certificate_kernel.h"
#include "core/validity/rounding.h"
#include "tests/core/support/made_cells.h"

namespace varimesh::detail {
namespace {

class Tables : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Bernstein, Tables, ::testing::ValuesIn(testing::kCellShapes),
                         [](const auto& shape) { return testing::name(shape.param); });

/// Barycentric coordinates (factor behind factor) of a point of the reference cell.
std::array<double, 6> barycentric(Shape shape, const Eigen::RowVectorXd& xi) {
  const auto half = [&](Eigen::Index c) { return (1 + xi(c)) / 2; };
  switch (shape) {
    case Shape::Triangle:
      return {1 - half(0) - half(1), half(0), half(1)};
    case Shape::Tetrahedron:
      return {1 - half(0) - half(1) - half(2), half(0), half(1), half(2)};
    case Shape::Prism:
      return {1 - half(0) - half(1), half(0), half(1), 1 - half(2), half(2)};
    case Shape::Pyramid: {
      const double s = 1 - half(2), u = (1 + xi(0) / s) / 2, v = (1 + xi(1) / s) / 2;
      return {1 - u, u, 1 - v, v, s, 1 - s};
    }
    case Shape::Quadrilateral:
      return {1 - half(0), half(0), 1 - half(1), half(1)};
    default:
      return {1 - half(0), half(0), 1 - half(1), half(1), 1 - half(2), half(2)};
  }
}

double evaluate(const BernsteinSpace& space, const std::vector<long double>& coefficients,
                const std::array<double, 6>& at) {
  long double sum = 0;
  for (int k = 0; k < space.size(); ++k) {
    long double term = coefficients[static_cast<std::size_t>(k)] * space.multinomial(k);
    for (std::size_t slot = 0; slot < 6; ++slot)
      term *= std::pow(static_cast<long double>(at[slot]), space.exponents()[static_cast<std::size_t>(k)][slot]);
    sum += term;
  }
  return static_cast<double>(sum);
}

CellToCertify hard_cell(const HighOrderMesh& mesh, std::size_t cell) {
  const ElementBlock& block = mesh.blocks[0];
  const JacobianTable& table = jacobian_table(block.shape, block.order);
  return {&table, mesh.coordinates.data(), block.nodes.data() + cell * static_cast<std::size_t>(table.nodes), 1, 1};
}

TEST_P(Tables, TheBernsteinFormOfJIsItsDeterminant) {
  const Shape shape = GetParam();
  for (int order = 1; order <= 5; ++order) {
    const HighOrderMesh mesh = testing::shaken_cells(shape, order, 1, 0.3, static_cast<unsigned>(order));
    const int d = mesh.dimension;
    const auto coefficients = extended_coefficients(hard_cell(mesh, 0)).values;
    // Strictly inside, so that the pyramid's basis has no trouble at the apex.
    reference::Points points = reference::uniform_lattice(shape, 3);
    const Eigen::RowVectorXd middle = points.colwise().mean();
    points = (0.9 * points).rowwise() + 0.1 * middle;
    const auto gradients = reference::basis_gradients(shape, order, reference::NodeSet::Equispaced, d, points);
    const int nodes = reference::node_count(shape, order);
    Eigen::MatrixXd x(nodes, d);
    for (int n = 0; n < nodes; ++n)
      for (int c = 0; c < d; ++c) x(n, c) = mesh.coordinates[static_cast<std::size_t>(3 * n + c)];
    for (Eigen::Index p = 0; p < points.rows(); ++p) {
      Eigen::MatrixXd jacobian(d, d);
      for (int r = 0; r < d; ++r) jacobian.col(r) = (gradients[static_cast<std::size_t>(r)].row(p) * x).transpose();
      const double expected = jacobian.determinant();
      EXPECT_NEAR(evaluate(jacobian_table(shape, order).jacobian, coefficients, barycentric(shape, points.row(p))),
                  expected, 1e-10 * std::max(1.0, std::abs(expected)))
          << "order " << order << ", point " << points.row(p);
    }
  }
}

TEST_P(Tables, TheKernelsCoefficientsAreWithinTheErrorItStates) {
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

TEST(Outward, IsTheNextDouble) {
  constexpr double infinity = std::numeric_limits<double>::infinity(),
                   least = std::numeric_limits<double>::denorm_min(), most = std::numeric_limits<double>::max();
  for (const double x : {0.0, -0.0, least, -least, 2 * least, -2 * least, 1.0, -1.0, 1 - 0x1p-53, -2.0, 0x1p-1022,
                         -0x1p-1022, most, -most, infinity, -infinity, 3e-310, 6.02e23}) {
    EXPECT_EQ(next_above(x), std::nextafter(x, infinity)) << x;
    EXPECT_EQ(next_below(x), std::nextafter(x, -infinity)) << x;
  }
  EXPECT_TRUE(std::isnan(next_above(std::nan(""))) && std::isnan(next_below(std::nan(""))));
}

TEST_P(Tables, DegreesAreTheKnownOnes) {
  const int coefficients[6][5] = {{6, 15, 28, 45, 66},        {16, 36, 64, 100, 144},
                                  {20, 84, 220, 455, 816},    {144, 567, 1440, 2925, 5184},
                                  {90, 324, 792, 1575, 2754}, {216, 729, 1728, 3375, 5832}};
  for (int order = 2; order <= 6; ++order)
    EXPECT_EQ(jacobian_table(GetParam(), order).jacobian.size(),
              coefficients[static_cast<int>(GetParam()) - static_cast<int>(Shape::Triangle)][order - 2]);
}

}  // namespace
}  // namespace varimesh::detail
