// The gradient operator, split by the cell's mirrors, against the table that it was made from.
#include "core/kernels/hessian/folded_gradient.h"

#include <gtest/gtest.h>

#include <bit>

#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

double sign(int a, int b) { return std::popcount(static_cast<unsigned>(a & b)) % 2 == 0 ? 1 : -1; }

/// The components of the values at an orbit's members, or the values from their components: Σ ± over the orbit.
std::vector<double> with_signs(const std::vector<FoldedGradient::Orbit>& orbits, const std::vector<double>& from,
                               bool to_components) {
  std::vector<double> to(from.size());
  for (const FoldedGradient::Orbit& orbit : orbits) {
    const auto &source = to_components ? orbit.member : orbit.component,
               &target = to_components ? orbit.component : orbit.member;
    for (int a = 0; a < 1 << orbit.mirrors; ++a)
      for (int b = 0; b < 1 << orbit.mirrors; ++b) to[target[a]] += sign(a, b) * from[source[b]];
  }
  return to;
}

class FoldedGradientOf : public ::testing::TestWithParam<std::tuple<Filling, int>> {};

TEST_P(FoldedGradientOf, IsTheTableThatItWasMadeFrom) {
  const auto [filling, order] = GetParam();
  const Problem problem = testing::make_problem(testing::grid(filling, {1, 1, 1}, order));
  for (const CellSet& cells : problem.sets) {
    const FoldedGradient folded = fold_gradient(cells);
    const int d = cells.dimension;
    std::size_t rows = 0;
    for (const FoldedGradient::Parity& part : folded.parities) rows += part.rows.size();
    EXPECT_EQ(rows, std::size_t(cells.points) * d);  // each is set by one of the parts
    for (int n = 0; n < cells.nodes_per_cell; ++n) {
      std::vector<double> unit(cells.nodes_per_cell);
      unit[n] = 1;
      const std::vector<double> components = with_signs(folded.node_orbits, unit, true);
      std::vector<std::vector<double>> slots(d, std::vector<double>(cells.points));
      for (const FoldedGradient::Parity& part : folded.parities)
        for (std::size_t row = 0; row < part.rows.size(); ++row)
          for (int i = 0; i < part.nodes; ++i) {
            ASSERT_EQ(part.forward[i * part.rows.size() + row], part.backward[row * part.nodes + i]);
            slots[part.rows[row] % (d * d)][part.rows[row] / (d * d)] +=
                part.backward[row * part.nodes + i] * components[part.first + i];
          }
      for (int alpha = 0; alpha < d; ++alpha) {
        const std::vector<double> values = with_signs(folded.point_orbits, slots[alpha], false);
        for (int slot = 0; slot < cells.points; ++slot) {
          double expected = 0;
          for (int k = 0; k < d; ++k)
            expected += folded.directions(alpha, k) * cells.derivatives_of(n)[k * cells.stride + folded.points[slot]];
          EXPECT_NEAR(values[slot], expected, 3e-6 * order * order) << "node " << n << ", slot " << slot;
        }
      }
    }
  }
}

TEST(FoldedGradient, HasAShareOfTheTablesEntries) {
  const auto share = [](Filling filling, int order) {
    const Problem problem = testing::make_problem(testing::grid(filling, {1, 1, 1}, order));
    const CellSet& cells = problem.sets[0];
    double entries = 0;
    for (const FoldedGradient::Parity& part : fold_gradient(cells).parities) entries += double(part.backward.size());
    return entries / (double(cells.points) * cells.nodes_per_cell * cells.dimension);
  };
  // The share is 2^−mirrors, and a little more because some nodes and points lie on a mirror.
  EXPECT_NEAR(share(Filling::Triangles, 5), 0.5, 0.02);
  EXPECT_NEAR(share(Filling::Quadrilaterals, 4), 0.25, 0.02);
  EXPECT_NEAR(share(Filling::Tetrahedra, 4), 0.25, 0.02);
  EXPECT_NEAR(share(Filling::Hexahedra, 3), 0.125, 0.01);
}

INSTANTIATE_TEST_SUITE_P(EveryShape, FoldedGradientOf,
                         ::testing::Combine(::testing::Values(Filling::Triangles, Filling::Quadrilaterals,
                                                              Filling::Tetrahedra, Filling::Pyramids, Filling::Prisms,
                                                              Filling::Hexahedra),
                                            ::testing::Values(1, 2, 3, 4, 5, 8)),
                         [](const auto& info) {
                           return std::string(testing::name(std::get<0>(info.param))) + "OfOrder" +
                                  std::to_string(std::get<1>(info.param));
                         });

}  // namespace
}  // namespace varimesh
