// The p-norm over cells: its derivatives against differences, and its star against the sum of its cells.
#include "core/kernels/p_norm.h"

#include <gtest/gtest.h>

#include "core/base/index.h"
#include "core/kernels/node_star.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

TEST(PNorm, OfOneIsTheSum) {
  const PNorm norm{1};
  EXPECT_TRUE(norm.is_sum());
  EXPECT_EQ(norm.value(3, 7), 3);
  EXPECT_EQ(norm.slope(3, 7), 1);
  EXPECT_EQ(norm.curvature(3, 7), 0);
}

TEST(PNorm, WeighsThePowerOfTheMeanByVolume) {
  // V (E/V)^p with E = 6, V = 2, p = 3.
  const PNorm norm{3};
  EXPECT_FALSE(norm.is_sum());
  EXPECT_DOUBLE_EQ(norm.value(6, 2), 2 * 27);
  EXPECT_DOUBLE_EQ(norm.slope(6, 2), 3 * 9);
  EXPECT_DOUBLE_EQ(norm.curvature(6, 2), 3 * 2 * 3 / 2.0);
}

TEST(PNorm, HasTheDerivativesOfItsValue) {
  for (const double p : {1.5, 2.0, 4.0, 8.0})
    for (const double E : {0.2, 1.0, 5.0}) {
      const PNorm norm{p};
      const double V = 0.7, h = 1e-5 * E;
      EXPECT_NEAR(norm.slope(E, V), (norm.value(E + h, V) - norm.value(E - h, V)) / (2 * h), 1e-7 * norm.slope(E, V));
      EXPECT_NEAR(norm.curvature(E, V), (norm.slope(E + h, V) - norm.slope(E - h, V)) / (2 * h),
                  1e-7 * norm.curvature(E, V));
    }
}

TEST(PNorm, IsFiniteForEnergiesThatRoundingMadeNegative) {
  for (const double p : {1.5, 2.0, 8.0}) {
    EXPECT_TRUE(std::isfinite(PNorm{p}.value(-1e-17, 1)));
    EXPECT_TRUE(std::isfinite(PNorm{p}.slope(-1e-17, 1)));
    EXPECT_TRUE(std::isfinite(PNorm{p}.curvature(-1e-17, 1)));
  }
}

/// Stars in a curved mesh, with plain kernels.
class PNormOfStars : public ::testing::TestWithParam<Filling> {
 protected:
  PNormOfStars() : problem_(testing::make_problem(mesh())) {
    kernels_ = make_plain_kernels(material(Options{}), problem_.dimension);
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
  std::unique_ptr<Kernels> kernels_;
};

INSTANTIATE_TEST_SUITE_P(Fillings, PNormOfStars, ::testing::Values(Filling::MixedPlane, Filling::MixedSolid),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(PNormOfStars, AddsUpTheCellsValues) {
  const PNorm norm{3};
  for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); rank += 3) {
    NodeStar star(problem_, rank);
    double sum = 0;
    for (std::int64_t i = problem_.offsets[std::size_t(rank)]; i < problem_.offsets[std::size_t(rank) + 1]; ++i) {
      const Incidence& at = problem_.incidences[std::size_t(i)];
      const CellSet& set = problem_.sets[std::size_t(at.set)];
      sum += norm.value(kernels_->scan_kept(set, at.cell).energy, cell_measure(set, at.cell));
    }
    const double still[3] = {0, 0, 0};
    EXPECT_NEAR(expand(*kernels_, star.cells(), norm).energy, sum, 1e-12 * sum);
    EXPECT_NEAR(energy_after(*kernels_, star.cells(), still, norm), sum, 1e-12 * sum);
  }
}

TEST_P(PNormOfStars, ExpandsToSecondOrder) {
  const PNorm norm{3};
  const int d = problem_.dimension;
  for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); rank += 3) {
    NodeStar star(problem_, rank);
    const StarExpansion here = expand(*kernels_, star.cells(), norm);
    const auto energy = [&](int i, double a, int j, double b) {
      double step[3] = {0, 0, 0};
      step[i] += a;
      step[j] += b;
      return energy_after(*kernels_, star.cells(), step, norm);
    };
    constexpr double h = 1e-4;
    double size = 0;
    for (const double entry : here.hessian) size = std::max(size, std::abs(entry));
    for (int i = 0; i < d; ++i) {
      EXPECT_NEAR(here.gradient[std::size_t(i)], (energy(i, h, i, 0) - energy(i, -h, i, 0)) / (2 * h), 1e-5 * size);
      for (int j = 0; j <= i; ++j) {
        const auto difference = [&](double t) {
          return (energy(i, t, j, t) - energy(i, t, j, -t) - energy(i, -t, j, t) + energy(i, -t, j, -t)) / (4 * t * t);
        };
        // Richardson's extrapolation takes away the error of second order in h.
        EXPECT_NEAR(here.hessian[std::size_t(symmetric_index(i, j))], (4 * difference(h / 2) - difference(h)) / 3,
                    1e-5 * size);
      }
    }
  }
}

}  // namespace
}  // namespace varimesh
