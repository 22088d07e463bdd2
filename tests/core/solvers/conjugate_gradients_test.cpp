// Conjugate gradients on small dense matrices.
#include "core/solvers/conjugate_gradients.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

namespace varimesh {
namespace {

/// A x = b, preconditioned with the diagonal of A.
struct DenseSystem {
  Eigen::MatrixXd A;
  Eigen::VectorXd x, r, z, p, Ap;
  double target = 0;  // of r · z

  DenseSystem(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& b)
      : A(matrix), x(Eigen::VectorXd::Zero(b.size())), r(b) {}

  ConjugateGradients solve(int most_products) {
    const double rz = precondition();
    p = z;
    return conjugate_gradients(*this, rz, most_products);
  }
  double multiply() {
    Ap = A * p;
    return p.dot(Ap);
  }
  void advance(double alpha) {
    x += alpha * p;
    r -= alpha * Ap;
  }
  double precondition() {
    z = r.cwiseQuotient(A.diagonal().cwiseAbs());
    return r.dot(z);
  }
  bool is_solved(double rz) const { return rz <= target; }
  void turn(double beta) { p = z + beta * p; }
};

/// Symmetric positive definite, with eigenvalues far apart.
Eigen::MatrixXd matrix(int rows) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Constant(rows, rows, 0.3);
  for (int i = 0; i < rows; ++i) A(i, i) = 1 + i * i;
  return A;
}

TEST(ConjugateGradients, SolveInAsManyProductsAsThereAreRows) {
  const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(6, 1, 2);
  DenseSystem system(matrix(6), b);
  system.target = 1e-24;
  const ConjugateGradients result = system.solve(100);
  EXPECT_LE(result.products, 7);
  EXPECT_FALSE(result.negative_curvature);
  EXPECT_LT((system.A * system.x - b).norm(), 1e-10);
}

TEST(ConjugateGradients, StopWhenTheSystemIsSolvedWellEnough) {
  const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(6, 1, 2);
  DenseSystem rough(matrix(6), b), fine(matrix(6), b);
  rough.target = 1e-2;
  fine.target = 1e-24;
  EXPECT_LT(rough.solve(100).products, fine.solve(100).products);
  EXPECT_LE(rough.r.dot(rough.z), rough.target);
  EXPECT_TRUE(rough.solve(100).solved);
}

TEST(ConjugateGradients, TakeNoMoreProductsThanAllowed) {
  DenseSystem system(matrix(6), Eigen::VectorXd::Ones(6));
  const ConjugateGradients result = system.solve(2);
  EXPECT_EQ(result.products, 2);
  EXPECT_FALSE(result.solved);
}

TEST(ConjugateGradients, TakeNoStepAlongNegativeCurvature) {
  Eigen::MatrixXd A = matrix(3);
  A(0, 0) = -5;
  DenseSystem system(A, Eigen::VectorXd::Unit(3, 0));
  const ConjugateGradients result = system.solve(100);
  EXPECT_TRUE(result.negative_curvature);
  EXPECT_FALSE(result.solved);
  EXPECT_EQ(result.products, 1);
  EXPECT_EQ(system.x.norm(), 0);
}

TEST(ConjugateGradients, HaveNothingToDoForAZeroRightHandSide) {
  DenseSystem system(matrix(3), Eigen::VectorXd::Zero(3));
  EXPECT_EQ(system.solve(100).products, 0);
}

}  // namespace
}  // namespace varimesh
