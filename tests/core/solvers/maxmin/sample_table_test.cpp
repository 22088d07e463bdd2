// The kernels of the samples against plain products of matrices.
#include "core/solvers/maxmin/sample_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/base/index.h"
#include "core/reference/basis.h"

namespace varimesh {
namespace {

/// Numbers without a pattern, between −1 and 1.
std::vector<double> numbers(std::size_t count) {
  std::vector<double> result(count);
  for (std::size_t i = 0; i < count; ++i) result[i] = std::sin(1.7 * static_cast<double>(i * i % 1009) + 0.3);
  return result;
}

class SampleTables : public ::testing::TestWithParam<std::pair<Shape, int>> {};

TEST_P(SampleTables, AgreeWithPlainProducts) {
  const auto [shape, order] = GetParam();
  const int d = reference::info(shape).dimension;
  const reference::Points points = reference::uniform_lattice(shape, order + 2);
  const SampleTable table(shape, order, d, points);
  const auto gradients = reference::basis_gradients(shape, order, reference::NodeSet::Equispaced, d, points);
  const std::size_t dim = at(d), nodes = table.nodes(), count = table.points(), padded = table.padded_points();
  ASSERT_EQ(count, at(points.rows()));
  ASSERT_EQ(nodes, at(gradients[0].cols()));
  ASSERT_GE(padded, count);

  const std::vector<double> x = numbers(nodes * dim);
  std::vector<double> derivatives(dim * dim * padded), weights(dim * dim * padded), sums(nodes * dim);
  table.differentiate(x.data(), derivatives.data());
  const std::vector<double> weight = numbers(dim * dim * count);
  for (std::size_t pair = 0; pair < dim * dim; ++pair)
    for (std::size_t i = 0; i < count; ++i) weights[pair * padded + i] = weight[pair * count + i];
  table.add_up(weights.data(), sums.data());

  std::vector<double> expected_sums(nodes * dim);
  for (std::size_t k = 0; k < dim; ++k)
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t c = 0; c < dim; ++c) {
        double expected = 0;
        for (std::size_t n = 0; n < nodes; ++n) {
          const double gradient = gradients[k](static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(n));
          ASSERT_EQ(table.gradient(i, n, k), gradient);
          expected += gradient * x[n * dim + c];
          expected_sums[n * dim + c] += gradient * weights[(k * dim + c) * padded + i];
        }
        ASSERT_NEAR(derivatives[(k * dim + c) * padded + i], expected, 1e-12 * static_cast<double>(nodes));
      }
  for (std::size_t entry = 0; entry < sums.size(); ++entry)
    EXPECT_NEAR(sums[entry], expected_sums[entry], 1e-12 * static_cast<double>(count)) << entry;
}

INSTANTIATE_TEST_SUITE_P(Shapes, SampleTables,
                         ::testing::Values(std::pair(Shape::Triangle, 3), std::pair(Shape::Quadrilateral, 4),
                                           std::pair(Shape::Tetrahedron, 1), std::pair(Shape::Tetrahedron, 4),
                                           std::pair(Shape::Prism, 2), std::pair(Shape::Pyramid, 2),
                                           std::pair(Shape::Hexahedron, 3)));

}  // namespace
}  // namespace varimesh
