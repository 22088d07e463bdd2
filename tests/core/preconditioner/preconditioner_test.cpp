// The preconditioner: its node blocks against plain inverses, and what it returns.
#include "core/preconditioner/preconditioner.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "core/energy/material.h"
#include "core/kernels/hessian/batches.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

/// A curved mesh with its Hessian linearised and the coarse level assembled.
class PreconditionerOn : public ::testing::TestWithParam<Filling> {
 protected:
  PreconditionerOn() : problem_(testing::make_problem(mesh())) {
    const int d = problem_.dimension;
    const auto kernels = make_kernels(material(Options{}), d);
    hessian_ = make_hessian_kernels(material(Options{}), d);
    hold_deformation(problem_, false);
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) kernels->rebuild(set, cell, problem_.positions);
    batches_ = make_batches(problem_, *hessian_);
    for (BatchSet& set : batches_)
      for (std::int32_t b = 0; b < set.count; ++b) hessian_->linearise(set, b, set.cells->deformation_of(b * kBatch));
  }

  static HighOrderMesh mesh() {
    return testing::grid(GetParam(), {4, 3, 2}, 3, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
  }

  std::vector<float> random_vector(unsigned seed) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> uniform(-1, 1);
    std::vector<float> vector(problem_.free.size() * std::size_t(problem_.dimension));
    for (float& x : vector) x = uniform(random);
    return vector;
  }

  /// M⁻¹ r with these blocks; `along` becomes r · M⁻¹ r.
  std::vector<float> apply(const std::vector<std::array<double, 6>>& blocks, const std::vector<float>& r, double& along,
                           int threads = 1) {
    const Team team(threads);
    std::vector<float> z(r.size() + std::size_t(padded(problem_.dimension)));
    team.run([&] {
      Preconditioner preconditioner(problem_, batches_, team);
      preconditioner.assemble(*hessian_);
      for (std::size_t rank = 0; rank < blocks.size(); ++rank)
        preconditioner.set_block(std::int32_t(rank), blocks[rank]);
      along = preconditioner.apply(r, z);
    });
    EXPECT_EQ(std::vector<float>(z.begin() + std::ptrdiff_t(r.size()), z.end()),
              std::vector<float>(std::size_t(padded(problem_.dimension)), 0.0F))
        << "the zeros at the end stay";
    z.resize(r.size());
    return z;
  }

  /// Blocks with these eigenvalues and random axes, one per free node.
  std::vector<std::array<double, 6>> random_blocks(const Eigen::Vector3d& eigenvalues) const {
    const int d = problem_.dimension;
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    std::vector<std::array<double, 6>> blocks(problem_.free.size());
    for (auto& block : blocks) {
      Eigen::MatrixXd axes(d, d);
      for (int i = 0; i < d * d; ++i) axes(i / d, i % d) = normal(random);
      const Eigen::MatrixXd Q = Eigen::HouseholderQR<Eigen::MatrixXd>(axes).householderQ();
      const Eigen::MatrixXd H = Q * eigenvalues.head(d).asDiagonal() * Q.transpose();
      for (int i = 0, entry = 0; i < d; ++i)
        for (int j = 0; j <= i; ++j, ++entry) block[std::size_t(entry)] = H(i, j);
    }
    return blocks;
  }

  /// The part of M⁻¹ r that is due to the blocks must be B r with B of these eigenvalues on the blocks' axes.
  void expect_inverse(const Eigen::Vector3d& eigenvalues, const Eigen::Vector3d& inverse) {
    const int d = problem_.dimension;
    const std::vector<float> r = random_vector(1);
    double along = 0;
    const std::vector<float> coarse = apply({}, r, along);
    const std::vector<float> both = apply(random_blocks(eigenvalues), r, along);
    const auto inverses = random_blocks(inverse);
    const double size = inverse.cwiseAbs().maxCoeff();
    for (std::size_t rank = 0; rank < problem_.free.size(); ++rank)
      for (int i = 0; i < d; ++i) {
        double expected = coarse[rank * std::size_t(d) + std::size_t(i)];
        for (int j = 0; j < d; ++j)
          expected += inverses[rank][std::size_t(symmetric_index(i, j))] * r[rank * std::size_t(d) + std::size_t(j)];
        EXPECT_NEAR(both[rank * std::size_t(d) + std::size_t(i)], expected, 1e-5 * size + 1e-5 * std::abs(expected));
      }
  }

  Problem problem_;
  std::unique_ptr<HessianKernels> hessian_;
  std::vector<BatchSet> batches_;
};

INSTANTIATE_TEST_SUITE_P(Fillings, PreconditionerOn, ::testing::Values(Filling::MixedPlane, Filling::MixedSolid),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(PreconditionerOn, InvertsPositiveBlocks) { expect_inverse({2, 0.5, 0.25}, {0.5, 2, 4}); }

TEST_P(PreconditionerOn, MakesNegativeEigenvaluesPositive) { expect_inverse({2, -0.5, -0.25}, {0.5, 2, 4}); }

TEST_P(PreconditionerOn, KeepsEigenvaluesAboveAThousandthOfTheLargest) {
  expect_inverse({1, 1e-6, 0}, {1, 1000, 1000});
}

TEST_P(PreconditionerOn, LeavesANodeWithoutABlockToTheCoarseLevel) { expect_inverse({0, 0, 0}, {0, 0, 0}); }

TEST_P(PreconditionerOn, ReturnsTheProductWithItsArgument) {
  const std::vector<float> r = random_vector(2);
  double along = 0, expected = 0;
  const std::vector<float> z = apply(random_blocks({2, 0.5, 0.25}), r, along);
  for (std::size_t i = 0; i < r.size(); ++i) expected += double(r[i]) * z[i];
  EXPECT_NEAR(along, expected, 1e-9 * expected);
  EXPECT_GT(along, 0);
}

TEST_P(PreconditionerOn, GivesTheSameBitsOnAnyNumberOfThreads) {
  const std::vector<float> r = random_vector(3);
  double one = 0, four = 0;
  EXPECT_EQ(apply(random_blocks({2, 0.5, 0.25}), r, one, 1), apply(random_blocks({2, 0.5, 0.25}), r, four, 4));
  EXPECT_EQ(one, four);
}

}  // namespace
}  // namespace varimesh
