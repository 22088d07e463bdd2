// Newton's method on functions of a few numbers with known minima.
#include "core/solvers/newton_method.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "core/base/stop_token.h"

namespace varimesh {
namespace {

/// Σ w_k f(x_k) with the exact Hessian, which is diagonal, and M = m times the unit matrix.
class Separable : public Minimised {
 public:
  struct Function {
    double (*value)(double), (*first)(double), (*second)(double);
  };
  Separable(Function function, std::vector<double> weights, double start)
      : x(weights.size(), start), function_(function), weights_(std::move(weights)) {}

  double linearise(bool renews) override {
    renewed += renews ? 1 : 0;
    start_ = x;
    h_.clear();
    for (std::size_t k = 0; k < x.size(); ++k) h_.push_back(weights_[k] * function_.second(x[k]));
    begin();
    return value();
  }
  bool make_convex() override {
    if (!has_convex_part) return false;
    for (double& h : h_) h = std::max(h, 1.0);
    begin();
    return true;
  }
  double precondition() override {
    q_ = r_;
    for (std::size_t k = 0; k < q_.size(); ++k) q_[k] /= exact ? h_[k] : m;
    return dot(r_, q_);
  }
  double multiply() override {
    for (std::size_t k = 0; k < q_.size(); ++k) q_[k] = h_[k] * p_[k];
    return dot(p_, q_);
  }
  void advance(double alpha) override {
    for (std::size_t k = 0; k < r_.size(); ++k) {
      step_[k] += alpha * p_[k];
      r_[k] -= alpha * q_[k];
    }
  }
  void turn(double beta) override {
    for (std::size_t k = 0; k < q_.size(); ++k) p_[k] = q_[k] + (beta == 0 ? 0 : beta * p_[k]);
  }
  void take_direction() override { step_ = p_; }
  double gradient_norm() override { return std::sqrt(dot(g_, g_)); }
  double preconditioned_norm(double rq) const override { return std::sqrt(rq); }
  double largest_step() override {
    double largest = 0;
    for (const double one : step_) largest = std::max(largest, std::abs(one));
    return largest;
  }
  double finish_step() override {
    for (double& one : step_) one *= shortened;
    return dot(g_, step_);
  }
  double move(double alpha) override {
    alphas.push_back(alpha);
    for (std::size_t k = 0; k < x.size(); ++k) x[k] = start_[k] + alpha * step_[k];
    if (interrupts) throw Interrupted();
    return value();
  }
  void settle() override { ++settled; }
  void go_back() override { x = start_; }

  double value() const {
    double sum = 0;
    for (std::size_t k = 0; k < x.size(); ++k) sum += weights_[k] * function_.value(x[k]);
    return sum;
  }

  std::vector<double> x, alphas;
  double m = 1, shortened = 1;
  bool exact = false, has_convex_part = false, interrupts = false;
  int settled = 0, renewed = 0;

 private:
  void begin() {
    g_.clear();
    r_.clear();
    for (std::size_t k = 0; k < x.size(); ++k) {
      g_.push_back(weights_[k] * function_.first(x[k]));
      r_.push_back(-g_[k]);
    }
    step_.assign(x.size(), 0);
    q_.assign(x.size(), 0);
    p_.assign(x.size(), std::numeric_limits<double>::quiet_NaN());
  }
  static double dot(const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0;
    for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
    return sum;
  }

  Function function_;
  std::vector<double> weights_, start_, h_, g_, r_, step_, p_, q_;
};

constexpr Separable::Function kParabola{[](double x) { return x * x / 2; }, [](double x) { return x; },
                                        [](double) { return 1.0; }};
/// (x² − 1)², which is concave between the two minima.
constexpr Separable::Function kTwoWells{[](double x) { return (x * x - 1) * (x * x - 1); },
                                        [](double x) { return 4 * x * (x * x - 1); },
                                        [](double x) { return 12 * x * x - 4; }};

NewtonRules rules(double forcing) {
  NewtonRules rules;
  rules.most_products = 20;
  rules.forcing = forcing;
  return rules;
}

TEST(NewtonMethodTest, SolvesAParabolaInOneStepWithAProductPerEigenvalue) {
  Separable objective(kParabola, {1, 4, 9}, 1);
  const NewtonOutcome outcome = NewtonMethod(objective, rules(1e-12)).step();
  EXPECT_EQ(outcome.linear_solve, LinearSolve::Solved);
  EXPECT_EQ(outcome.products, 3);
  EXPECT_EQ(outcome.damping, 1);
  EXPECT_DOUBLE_EQ(outcome.before, 7);
  EXPECT_NEAR(outcome.after, 0, 1e-20);
  EXPECT_NEAR(outcome.residual, 1, 1e-12);
  EXPECT_EQ(objective.settled, 1);
}

TEST(NewtonMethodTest, TakesTheStepOfAnExactPreconditionerWithoutAProduct) {
  Separable objective(kParabola, {1, 4, 9}, 1);
  objective.exact = true;
  const NewtonOutcome outcome = NewtonMethod(objective, {}).step();
  EXPECT_EQ(outcome.products, 0);
  for (const double x : objective.x) EXPECT_NEAR(x, 0, 1e-15);
}

TEST(NewtonMethodTest, GoesDownhillWhereTheObjectiveIsConcave) {
  Separable objective(kTwoWells, {1, 1}, 0.1);
  const NewtonOutcome outcome = NewtonMethod(objective, rules(0.1)).step();
  EXPECT_EQ(outcome.linear_solve, LinearSolve::NegativeCurvature);
  EXPECT_GT(outcome.damping, 0);
  EXPECT_LT(outcome.after, outcome.before);
  EXPECT_DOUBLE_EQ(outcome.after, objective.value());
}

TEST(NewtonMethodTest, SolvesWithAConvexPartIfNegativeCurvatureComesSoon) {
  Separable objective(kTwoWells, {1, 1}, 0.1);
  objective.has_convex_part = true;
  NewtonRules convex = rules(0.1);
  EXPECT_EQ(NewtonMethod(objective, convex).step().linear_solve, LinearSolve::NegativeCurvature);
  objective.x = {0.1, 0.1};
  convex.few_products = 1;
  const NewtonOutcome outcome = NewtonMethod(objective, convex).step();
  EXPECT_EQ(outcome.linear_solve, LinearSolve::Solved);
  EXPECT_EQ(outcome.products, 2) << "one that met negative curvature, and one of the convex part";
  EXPECT_NEAR(outcome.residual, 4 * 0.1 * (1 - 0.01), 1e-12);
}

TEST(NewtonMethodTest, BeginsWithAConvexPartAfterAStepThatWasMuchTooLong) {
  Separable objective(kTwoWells, {1, 1}, 0.1);
  objective.has_convex_part = true;
  objective.m = 0.01;  // the step along the direction of negative curvature is 39.6
  NewtonRules convex = rules(0.1);
  convex.convex_below = 0.25;
  NewtonMethod method(objective, convex);
  const NewtonOutcome long_step = method.step();
  EXPECT_EQ(long_step.linear_solve, LinearSolve::NegativeCurvature);
  EXPECT_LT(long_step.damping, 0.25);
  for (int step = 0; step < 2; ++step) {
    objective.x = {0.1, 0.1};
    const NewtonOutcome outcome = method.step();
    EXPECT_EQ(outcome.linear_solve, LinearSolve::Solved);
    EXPECT_EQ(outcome.products, 1) << "no product with a Hessian that is not convex";
    EXPECT_EQ(outcome.damping, 1);
  }

  objective.m = 1;  // a step of 0.396
  objective.x = {0.1, 0.1};
  NewtonMethod another(objective, convex);
  EXPECT_EQ(another.step().damping, 1);
  objective.x = {0.1, 0.1};
  EXPECT_EQ(another.step().linear_solve, LinearSolve::NegativeCurvature) << "the step before was taken as a whole";
}

TEST(NewtonMethodTest, LeavesTheUnknownsIfNothingIsLower) {
  Separable objective({[](double x) { return std::abs(x); }, [](double) { return 1.0; }, [](double) { return 1.0; }},
                      {1}, 0);
  const NewtonOutcome outcome = NewtonMethod(objective, rules(0.1)).step();
  EXPECT_EQ(outcome.damping, 0);
  EXPECT_EQ(outcome.after, outcome.before);
  EXPECT_EQ(objective.x[0], 0);
  EXPECT_EQ(objective.alphas.back(), 0);
  EXPECT_EQ(objective.settled, 0);
  EXPECT_EQ(objective.alphas.size(), 31U);
}

TEST(NewtonMethodTest, DoublesAStepAsLongAsTheObjectiveFalls) {
  Separable objective(kParabola, {1}, 1);
  objective.shortened = 0.3;
  NewtonRules doubling = rules(0.1);
  doubling.most_doublings = 4;
  const NewtonOutcome outcome = NewtonMethod(objective, doubling).step();
  EXPECT_EQ(outcome.damping, 4) << "1.2 of the way is nearer to the minimum than 0.6 and 2.4";
  EXPECT_NEAR(objective.x[0], -0.2, 1e-15);
  EXPECT_EQ(objective.alphas, (std::vector<double>{1, 2, 4, 8, 4}));
}

TEST(NewtonMethodTest, PutsTheUnknownsBackIfItIsInterrupted) {
  Separable objective(kParabola, {1, 4}, 1);
  objective.interrupts = true;
  EXPECT_THROW(NewtonMethod(objective, rules(0.1)).step(), Interrupted);
  EXPECT_EQ(objective.x, (std::vector<double>{1, 1}));
}

TEST(NewtonMethodTest, KeepsThePreconditionerWhileStepsAreShort) {
  Separable objective(kParabola, {1}, 0.01);
  NewtonMethod method(objective, rules(0.1));
  method.step();
  EXPECT_FALSE(method.renews());
  method.step();
  EXPECT_EQ(objective.renewed, 1);
  objective.x = {1};
  method.step();
  EXPECT_TRUE(method.renews()) << "a long step";
}

}  // namespace
}  // namespace varimesh
