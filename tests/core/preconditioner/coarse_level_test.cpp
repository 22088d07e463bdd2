// The coarse part of the preconditioner is symmetric and positive, and near the inverse of the Hessian.
#include "core/preconditioner/coarse_level.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/energy/material.h"
#include "core/preconditioner/preconditioner.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

class CoarseLevelTest : public ::testing::TestWithParam<Filling> {
 protected:
  void prepare(int order, int threads = 1) {
    const int dimension = testing::is_plane(GetParam()) ? 2 : 3;
    mesh_ = testing::grid(GetParam(), {4, 4, 3}, order, testing::bent(dimension));
    problem_ = testing::make_problem(mesh_);
    team_ = Team(threads);
    const Material material = varimesh::material(Options{});
    const auto kernels = make_kernels(material, dimension);
    hessian_ = make_hessian_kernels(material, dimension);
    hold_deformation(problem_, false);
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) kernels->rebuild(set, cell, problem_.positions);
    batches_ = make_batches(problem_, *hessian_);
    for (BatchSet& set : batches_)
      for (std::int32_t b = 0; b < set.count; ++b) hessian_->linearise(set, b, set.cells->deformation_of(b * kBatch));
    preconditioner_.emplace(problem_, batches_, team_);
    team_.run([&] { preconditioner_->coarse().assemble(*hessian_); });
  }

  std::vector<float> random_vector(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    std::vector<float> v(problem_.free.size() * static_cast<std::size_t>(problem_.dimension));
    for (float& x : v) x = normal(random);
    return v;
  }

  /// I V Iᵀ r. The nodes' own blocks are not set, so they are 0.
  std::vector<float> apply(std::vector<float> r) {
    const std::size_t size = r.size();
    r.resize(size + static_cast<std::size_t>(padded(problem_.dimension)));
    std::vector<float> z(r.size());
    team_.run([&] { preconditioner_->apply(r, z); });
    z.resize(size);
    return z;
  }

  static double dot(const std::vector<float>& a, const std::vector<float>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += static_cast<double>(a[i]) * b[i];
    return sum;
  }

  HighOrderMesh mesh_;
  Problem problem_;
  Team team_{1};
  std::unique_ptr<HessianKernels> hessian_;
  std::vector<BatchSet> batches_;
  std::optional<Preconditioner> preconditioner_;
};

TEST_P(CoarseLevelTest, IsSymmetricAndNotNegative) {
  for (const int order : {1, 2, 3}) {
    prepare(order);
    for (unsigned seed = 0; seed < 5; ++seed) {
      const std::vector<float> a = random_vector(2 * seed), b = random_vector(2 * seed + 1);
      const std::vector<float> Va = apply(a), Vb = apply(b);
      EXPECT_GT(dot(a, Va), 0);
      EXPECT_NEAR(dot(b, Va), dot(a, Vb), 1e-4 * std::sqrt(dot(a, Va) * dot(b, Vb))) << "order " << order;
    }
  }
}

TEST_P(CoarseLevelTest, IsNearTheInverseOfTheHessianOnAMeshOfOrderTwo) {
  prepare(2);
  // At order 2 the coarse space is the fine one, so I V Iᵀ H is near 1 in the norm of H.
  const std::vector<float> u = random_vector(3);
  std::vector<float> padded = u;
  padded.resize(u.size() + static_cast<std::size_t>(varimesh::padded(problem_.dimension)), 0.0F);
  std::vector<float> Hu(u.size(), 0.0F);
  for (BatchSet& set : batches_)
    for (std::int32_t b = 0; b < set.count; ++b) hessian_->apply(set, b, padded);
  const std::size_t d = problem_.dimension;
  for (std::size_t rank = 0; rank < problem_.free.size(); ++rank)
    for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
      const Incidence& at = problem_.incidences[i];
      const BatchSet& set = batches_[at.set];
      for (std::size_t k = 0; k < d; ++k)
        Hu[rank * d + k] += set.contributions[set.contribution_index(at.cell, at.local, d) + k];
    }
  const std::vector<float> VHu = apply(Hu);
  const double likeness = dot(Hu, VHu) / dot(Hu, u);
  EXPECT_GT(likeness, 0.4);
  EXPECT_LT(likeness, 2.0);
}

TEST_P(CoarseLevelTest, GivesTheSameBitsOnAnyNumberOfThreads) {
  prepare(3, 1);
  const std::vector<float> r = random_vector(1);
  const std::vector<float> one = apply(r);
  prepare(3, 4);
  EXPECT_EQ(apply(r), one);
}

INSTANTIATE_TEST_SUITE_P(Fillings, CoarseLevelTest, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return std::string(testing::name(info.param)); });

}  // namespace
}  // namespace varimesh
