// The preconditioner is symmetric and positive.
#include "core/solvers/descent/form/order_levels.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/quality/accuracy/team_accuracy.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

struct Bench {
  Bench(Filling filling, std::array<int, 3> counts, int order)
      : mesh(testing::grid(filling, counts, order, testing::bent(testing::is_plane(filling) ? 2 : 3))),
        problem(testing::make_problem(mesh)),
        space(own_space(problem, team)),
        form(problem, space, local_wave(mesh), team),
        levels(problem, space, team) {
    // The form does not depend on vertices. With a smaller stiffness, their diagonal would magnify rounding.
    levels.take_diagonals(form, std::vector<double>(static_cast<std::size_t>(problem.cells), 1e-4));
  }
  std::size_t unknowns() const { return problem.free.size() * problem.dimension; }

  Team team{1};
  HighOrderMesh mesh;
  Problem problem;
  OrderSpace space;
  ModalForm form;
  OrderLevels levels;
};

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

class OrderLevelsOf : public ::testing::TestWithParam<Filling> {};

INSTANTIATE_TEST_SUITE_P(Fillings, OrderLevelsOf, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& filling) { return std::string(testing::name(filling.param)); });

TEST_P(OrderLevelsOf, AreSymmetricAndPositive) {
  Bench bench(GetParam(), {2, 2, 2}, 4);
  std::vector<double> a = testing::random_direction(bench.problem, 1), b = testing::random_direction(bench.problem, 2);
  std::vector<double> of_a(a.size()), of_b(a.size());
  EXPECT_GT(bench.levels.apply(a, of_a), 0);
  EXPECT_GT(bench.levels.apply(b, of_b), 0);
  EXPECT_NEAR(dot(b, of_a), dot(a, of_b), 1e-10 * std::sqrt(dot(a, of_a) * dot(b, of_b)));
}

}  // namespace
}  // namespace varimesh
