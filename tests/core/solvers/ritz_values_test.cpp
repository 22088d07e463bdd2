// The ends of the spectrum from the coefficients of conjugate gradients.
#include "core/solvers/ritz_values.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/solvers/conjugate_gradients.h"

namespace varimesh {
namespace {

/// Conjugate gradients without a preconditioner on a diagonal matrix with these eigenvalues.
struct DiagonalSystem {
  Eigen::VectorXd eigenvalues, x, r, p, Ap;
  RitzValues ritz;

  ConjugateGradients solve(const Eigen::VectorXd& b, int most_products) {
    x = Eigen::VectorXd::Zero(b.size());
    r = p = b;
    ritz.clear();
    return conjugate_gradients(*this, r.squaredNorm(), most_products);
  }
  double multiply() {
    Ap = eigenvalues.cwiseProduct(p);
    return p.dot(Ap);
  }
  void advance(double alpha) {
    ritz.advance(alpha);
    x += alpha * p;
    r -= alpha * Ap;
  }
  double precondition() { return r.squaredNorm(); }
  bool is_solved(double rz) const { return rz < 1e-28; }
  void turn(double beta) {
    ritz.turn(beta);
    p = r + beta * p;
  }
};

TEST(RitzValues, AreTheEigenvaluesAfterAsManyStepsAsThereAre) {
  DiagonalSystem system;
  system.eigenvalues = Eigen::VectorXd{{0.003, 0.2, 1, 1.5, 7}};
  system.solve(Eigen::VectorXd::Ones(5), 5);
  ASSERT_EQ(system.ritz.count(), 5);
  EXPECT_NEAR(system.ritz.smallest(), 0.003, 1e-5);
  EXPECT_NEAR(system.ritz.largest(), 7, 1e-2);
}

TEST(RitzValues, LieBetweenTheEigenvaluesAndComeCloserToThem) {
  DiagonalSystem system;
  system.eigenvalues = Eigen::VectorXd::LinSpaced(200, 0.01, 2);
  double last = 2;
  for (const int products : {1, 5, 10, 20, 40}) {
    system.solve(Eigen::VectorXd::Ones(200), products);
    EXPECT_EQ(system.ritz.count(), products);
    EXPECT_LE(system.ritz.largest(), 2 * 1.001);
    EXPECT_GE(system.ritz.smallest(), 0.01 * 0.999);
    EXPECT_LT(system.ritz.smallest(), last);
    last = system.ritz.smallest();
  }
  EXPECT_LT(last, 0.012);
}

TEST(RitzValues, AreZeroBeforeTheFirstStep) {
  EXPECT_EQ(RitzValues().smallest(), 0);
  EXPECT_EQ(RitzValues().largest(), 0);
}

TEST(SpectrumEstimate, IsUnknownUntilASolveWasLongEnough) {
  // Eigenvalues as far apart as this need 2 √1000 = 63 steps.
  DiagonalSystem system;
  system.eigenvalues = Eigen::VectorXd::LinSpaced(400, 0.001, 1).array().square();
  system.eigenvalues.array() += 0.001;
  SpectrumEstimate spectrum;
  EXPECT_EQ(spectrum.estimate(system.ritz).smallest, 0);
  system.solve(Eigen::VectorXd::Ones(400), 3);
  EXPECT_EQ(spectrum.estimate(system.ritz).smallest, 0);
  spectrum.note(system.ritz);
  EXPECT_EQ(spectrum.estimate(RitzValues()).smallest, 0);
  system.solve(Eigen::VectorXd::Ones(400), 130);
  EXPECT_NEAR(spectrum.estimate(system.ritz).smallest, 0.001, 1e-4) << "the solve that is running counts";
}

TEST(SpectrumEstimate, RemembersTheLastFourSolves) {
  DiagonalSystem wide, narrow;
  wide.eigenvalues = Eigen::VectorXd{{0.25, 1}};
  narrow.eigenvalues = Eigen::VectorXd{{1, 1}};
  wide.solve(Eigen::VectorXd::Ones(2), 2);
  narrow.solve(Eigen::VectorXd::Ones(2), 1);
  // Two steps are not enough for the quotient 4, and one is not for the quotient 1.
  RitzValues known;
  for (int step = 0; step < 4; ++step) {
    known.advance(1);
    known.turn(0);
  }
  SpectrumEstimate spectrum;
  spectrum.note(wide.ritz);
  for (int solve = 0; solve < 3; ++solve) {
    spectrum.note(known);
    EXPECT_NEAR(spectrum.estimate(narrow.ritz).smallest, 0.25, 1e-3);
  }
  spectrum.note(known);
  EXPECT_NEAR(spectrum.estimate(narrow.ritz).smallest, 1, 1e-2) << "the first solve is forgotten";
}

}  // namespace
}  // namespace varimesh
