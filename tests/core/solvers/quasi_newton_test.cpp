// The quasi-Newton method on functions of a few numbers with known minima.
#include "core/solvers/quasi_newton.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace varimesh {
namespace {

/// Rosenbrock's function 100 (y − x²)² + (1 − x)², with its minimum 0 at (1, 1).
class Valley : public Smooth {
 public:
  double evaluate(std::span<double> gradient) override {
    ++evaluations;
    const double a = x[1] - x[0] * x[0], b = 1 - x[0];
    gradient[0] = -400 * a * x[0] - 2 * b;
    gradient[1] = 200 * a;
    return x[0] > most ? std::numeric_limits<double>::infinity() : 100 * a * a + b * b;
  }
  void precondition(std::span<const double> r, std::span<double> z) override {
    for (std::size_t k = 0; k < 2; ++k) z[k] = r[k] / 200;
  }
  void mark() override { start_ = x; }
  void move(double alpha, std::span<const double> step) override {
    for (std::size_t k = 0; k < 2; ++k) x[k] = start_[k] + alpha * step[k];
  }
  double largest(std::span<const double> step) const override { return std::max(std::abs(step[0]), std::abs(step[1])); }

  std::vector<double> x{-1.2, 1};
  double most = 1e9;
  int evaluations = 0;

 private:
  std::vector<double> start_;
};

QuasiNewtonOutcome minimised(Valley& valley, int most_steps) {
  QuasiNewtonOutcome outcome;
  const Team team(2);
  team.run([&] { outcome = QuasiNewton(2, team).minimise(valley, {most_steps, 20, 1e-12, 0}); });
  return outcome;
}

TEST(QuasiNewtonTest, FindsTheEndOfAValley) {
  Valley valley;
  const QuasiNewtonOutcome outcome = minimised(valley, 200);
  EXPECT_LT(outcome.steps, 100);
  EXPECT_NEAR(valley.x[0], 1, 1e-5);
  EXPECT_NEAR(valley.x[1], 1, 1e-5);
  EXPECT_NEAR(outcome.first_gradient, std::hypot(215.6, 88), 1e-9);
  EXPECT_LT(outcome.last_gradient, 1e-3 * outcome.first_gradient);
}

TEST(QuasiNewtonTest, MakesNoMoreStepsThanAllowed) {
  Valley valley;
  EXPECT_EQ(minimised(valley, 3).steps, 3);
}

TEST(QuasiNewtonTest, NeverGoesWhereTheObjectiveIsInfinite) {
  Valley valley;
  valley.most = 0.5;
  const QuasiNewtonOutcome outcome = minimised(valley, 200);
  EXPECT_GT(outcome.steps, 0);
  EXPECT_LE(valley.x[0], 0.5);
  valley.x = {0.6, 0.6};
  EXPECT_EQ(minimised(valley, 200).steps, 0) << "it is infinite at the start";
  EXPECT_EQ(valley.x, (std::vector<double>{0.6, 0.6}));
}

}  // namespace
}  // namespace varimesh
