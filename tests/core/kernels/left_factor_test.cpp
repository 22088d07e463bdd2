// A metric's left factor: what is known without it holds for the step L a.
#include "core/kernels/left_factor.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "core/base/index.h"
#include "core/kernels/node_star.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

TEST(TimesLeftFactor, MultipliesByARowMajorMatrix) {
  const double L[] = {1, 2, 3, 4, 5, 6, 7, 8, 9}, x[] = {1, 10, 100};
  double out[3];
  times_left_factor(L, 3, x, out);
  EXPECT_EQ(out[0], 321);
  EXPECT_EQ(out[1], 654);
  EXPECT_EQ(out[2], 987);
  times_left_factor(L, 2, x, out);  // the first four numbers as 2 × 2
  EXPECT_EQ(out[0], 21);
  EXPECT_EQ(out[1], 43);
}

TEST(TimesLeftFactor, LeavesTheVectorIfThereIsNoFactor) {
  const double x[] = {3, -4, 5};
  double out[3];
  times_left_factor(nullptr, 3, x, out);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(out[i], x[i]);
}

/// Stars whose cells all have the left factor L, of determinant 1, in F itself.
class LeftFactor : public ::testing::TestWithParam<Filling> {
 protected:
  LeftFactor() : problem_(testing::make_problem(mesh())) {
    const int d = problem_.dimension;
    L_ = Eigen::MatrixXd::Identity(d, d);
    L_(0, 1) = L_(1, 0) = 0.4;
    L_(0, 0) = 1.5;
    L_ /= std::pow(L_.determinant(), 1.0 / d);
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell)
        set.left_factor.insert(set.left_factor.end(), L_.data(), L_.data() + L_.size());  // symmetric
    kernels_ = make_plain_kernels(material(Options{}), d);
    hold_deformation(problem_, false);
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) kernels_->rebuild(set, cell, problem_.positions);
  }

  static HighOrderMesh mesh() {
    HighOrderMesh mesh = testing::grid(GetParam(), {2, 2, 2}, 2, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
    testing::shake(mesh, 0.02, 3);
    return mesh;
  }

  Problem problem_;
  Eigen::MatrixXd L_;
  std::unique_ptr<Kernels> kernels_;
};

INSTANTIATE_TEST_SUITE_P(Fillings, LeftFactor, ::testing::Values(Filling::MixedPlane, Filling::MixedSolid),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(LeftFactor, TurnsTheStepGradientAndHessian) {
  const int d = problem_.dimension;
  const double step[3] = {0.003, -0.002, 0.001};
  for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); rank += 2) {
    NodeStar star(problem_, rank);
    const StarExpansion with = expand_through_left_factors(*kernels_, d, star.cells());
    const double energy = energy_through_left_factors(*kernels_, d, star.cells(), step);
    // The same F without the factor: the step is L a, the gradient L g, the Hessian L H L.
    for (StarCell& cell : star.cells()) cell.left_factor = nullptr;
    const StarExpansion without = kernels_->expand(star.cells());
    Eigen::VectorXd g(d), a(d);
    Eigen::MatrixXd H(d, d);
    for (int i = 0; i < d; ++i) {
      g[i] = without.gradient[std::size_t(i)];
      a[i] = step[i];
      for (int j = 0; j < d; ++j) H(i, j) = without.hessian[std::size_t(symmetric_index(i, j))];
    }
    const Eigen::VectorXd Lg = L_ * g, La = L_ * a;
    const Eigen::MatrixXd LHL = L_ * H * L_;
    double turned[3] = {0, 0, 0};
    for (int i = 0; i < d; ++i) turned[i] = La[i];
    EXPECT_NEAR(with.energy, without.energy, 1e-13 * std::abs(without.energy));
    EXPECT_NEAR(energy, kernels_->energy_after(star.cells(), turned), 1e-13 * std::abs(energy));
    for (int i = 0; i < d; ++i) {
      EXPECT_NEAR(with.gradient[std::size_t(i)], Lg[i], 1e-12 * H.norm());
      for (int j = 0; j <= i; ++j)
        EXPECT_NEAR(with.hessian[std::size_t(symmetric_index(i, j))], LHL(i, j), 1e-12 * H.norm());
    }
  }
}

}  // namespace
}  // namespace varimesh
