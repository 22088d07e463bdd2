// The vectorised kernels against the plain ones, and the whole mesh's gradient against differences of its energy, for
// every energy and every shape.
#include "core/kernels/kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/kernels/node_star.h"
#include "tests/core/support/kernel_cases.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::make_problem;

/// The determinant of a d × d matrix whose entries are `stride` apart.
double determinant(const double* F, int d, int stride) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) matrix(i, j) = F[(i * d + j) * stride];
  return matrix.determinant();
}

class VectorKernels : public testing::KernelCases {};

INSTANTIATE_TEST_SUITE_P(Materials, VectorKernels, ::testing::ValuesIn(testing::every_kernel_case()),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(VectorKernels, ExpandAStarLikeThePlainOnes) {
  for (const auto [tangled, metric] : testing::kTreatments) {
    prepare(tangled, metric);
    ASSERT_EQ(invalid_ > 0, tangled);
    for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); rank += 3) {
      NodeStar star(problem_, rank);
      const StarExpansion a = fast_->expand(star.cells()), b = plain_->expand(star.cells());
      double gradient = 0, hessian = 0;
      for (const double g : b.gradient) gradient = std::max(gradient, std::abs(g));
      for (const double h : b.hessian) hessian = std::max(hessian, std::abs(h));
      EXPECT_NEAR(a.energy, b.energy, 1e-11 * (std::abs(b.energy) + b.measure));
      EXPECT_NEAR(a.measure, b.measure, 1e-13 * b.measure);
      // A gradient is a sum of much larger terms of both signs, which scale with the Hessian.
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(a.gradient[i], b.gradient[i], 1e-10 * (gradient + 0.01 * hessian));
      for (int i = 0; i < 6; ++i) EXPECT_NEAR(a.hessian[i], b.hessian[i], 1e-10 * hessian);
    }
  }
}

TEST_P(VectorKernels, TryAndTakeAStepLikeThePlainOnes) {
  for (const auto [tangled, metric] : testing::kTreatments) {
    prepare(tangled, metric);
    Problem copy = problem_;
    const double step[3] = {0.004, -0.003, 0.002};
    AlignedVector<double> lines(NodeStar::kMostNumbers);
    for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); rank += 5) {
      const int line_size =
          rank % 2 == 0 ? fast_->line_size() : 0;  // with the line that expand() leaves, and without it
      NodeStar fast_star(problem_, rank, line_size, lines.data()), plain_star(copy, rank);
      EXPECT_EQ(fast_star.cells()[0].line != nullptr, line_size > 0);
      if (rank % 4 == 0) fast_star.cells()[0].line = nullptr;  // as if there were no room for the first cell's line
      if (line_size > 0) fast_->expand(fast_star.cells());
      const double a = fast_->energy_after(fast_star.cells(), step), b = plain_->energy_after(plain_star.cells(), step);
      if (std::isinf(b))
        EXPECT_EQ(a, b);
      else
        EXPECT_NEAR(a, b, 1e-11 * (std::abs(b) + 1));
      EXPECT_NEAR(fast_->smallest_jacobian(fast_star.cells()), plain_->smallest_jacobian(plain_star.cells()), 1e-12);
      fast_->move(fast_star.cells(), step);
      plain_->move(plain_star.cells(), step);
    }
    for (std::size_t set = 0; set < copy.sets.size(); ++set)
      for (std::size_t i = 0; i < copy.sets[set].deformation.size(); ++i)
        ASSERT_NEAR(problem_.sets[set].deformation[i], copy.sets[set].deformation[i], 1e-12);
  }
}

TEST_P(VectorKernels, KeepTheEnergysFunctionOfJBesideF) {
  for (const auto [tangled, metric] : testing::kTreatments) {
    prepare(tangled, metric);
    drop_deformation(problem_);
    EXPECT_TRUE(hold_deformation(problem_, fast_->keeps_function()));
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) fast_->rebuild(set, cell, problem_.positions);
    const double step[3] = {0.004, -0.003, 0.002}, other[3] = {0.001, 0.002, -0.002};
    AlignedVector<double> lines(NodeStar::kMostNumbers);
    for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); ++rank) {
      // With the line that expand() leaves, without it, and with one δ for the whole star.
      NodeStar star(problem_, rank, rank % 3 == 0 ? fast_->line_size() : 0, lines.data()), anew(problem_, rank);
      for (StarCell& cell : anew.cells()) cell.jacobian_function = nullptr;
      if (std::isinf(fast_->energy_after(anew.cells(), step))) continue;  // no sweep would take this step
      if (rank % 3 == 1)
        for (NodeStar* each : {&star, &anew})
          for (StarCell& cell : each->cells()) cell.delta_squared = 1e-3;
      const StarExpansion a = fast_->expand(star.cells()), b = fast_->expand(anew.cells());
      EXPECT_NEAR(a.energy, b.energy, 1e-11 * (std::abs(b.energy) + b.measure));
      for (int i = 0; i < 6; ++i) EXPECT_NEAR(a.hessian[i], b.hessian[i], 1e-11 * std::abs(b.hessian[0]));
      fast_->energy_after(star.cells(), other);  // a step that is rejected
      fast_->energy_after(star.cells(), step);
      fast_->move(star.cells(), step);
    }
    AlignedVector<double> expected;
    for (CellSet& set : problem_.sets) {
      EXPECT_EQ(set.jacobian_function.empty(), !fast_->keeps_function());
      if (!fast_->keeps_function()) continue;
      expected.resize(set.stride);
      for (std::int32_t cell = 0; cell < set.count; ++cell) {
        const double* F = set.deformation_of(cell);
        fast_->take_function(F, set.stride, expected.data());
        for (int q = 0; q < set.stride; ++q) {
          if (!(determinant(F + q, set.dimension, set.stride) > 0)) continue;
          ASSERT_NEAR(set.jacobian_function_of(cell)[q], expected[q], 1e-10 * (1 + std::abs(expected[q])));
        }
        const CellScan kept = fast_->scan_kept(set, cell), anew = fast_->scan(set, cell, F, nullptr);
        EXPECT_NEAR(kept.energy, anew.energy, 1e-10 * (std::abs(anew.energy) + 1e-3));
      }
    }
  }
}

TEST_P(VectorKernels, ReadOneMatrixIfTheTargetsOfACellAreAlike) {
  const auto mesh = [](double shear, double taper) {
    return testing::grid(GetParam().filling, {3, 2, 2}, 2, [=](testing::Place at) {
      const auto [x, y, z] = at;
      return testing::Place{x + shear * y + taper * x * (y + z), y, z * (1 + taper * y)};
    });
  };
  problem_ = make_problem(mesh(0.3, 0.1));
  for (const CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) EXPECT_EQ(set.uniform_target_of(cell), nullptr);
  problem_ = make_problem(mesh(0.3, 0));
  fast_ = make_kernels(GetParam().material.material, problem_.dimension);
  hold_deformation(problem_, false);
  for (CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      EXPECT_EQ(set.uniform_target_of(cell) == nullptr, set.affine);
      fast_->rebuild(set, cell, problem_.positions);
    }
  Problem copy = problem_;
  for (CellSet& set : copy.sets) set.uniform_target.clear();
  const double step[3] = {0.004, -0.003, 0.002};
  for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); ++rank) {
    NodeStar one(problem_, rank), many(copy, rank);
    const StarExpansion a = fast_->expand(one.cells()), b = fast_->expand(many.cells());
    EXPECT_NEAR(a.measure, b.measure, 1e-13 * b.measure);
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(a.hessian[i], b.hessian[i], 1e-11 * b.hessian[0]);
    EXPECT_NEAR(fast_->energy_after(one.cells(), step), fast_->energy_after(many.cells(), step), 1e-12);
  }
}

TEST_P(VectorKernels, RebuildAndScanLikeThePlainOnes) {
  for (const bool metric : {false, true}) {
    prepare(true, metric);
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) {
        const CellScan b = plain_->scan_kept(set, cell);
        fast_->rebuild(set, cell, problem_.positions);
        const CellScan a = fast_->scan_kept(set, cell);
        EXPECT_NEAR(a.energy, b.energy, 1e-10 * (std::abs(b.energy) + 1e-3));
        EXPECT_NEAR(a.smallest_jacobian, b.smallest_jacobian, 1e-12);
        EXPECT_NEAR(a.scaled_jacobian, b.scaled_jacobian, 1e-12);
      }
  }
}

TEST_P(VectorKernels, TheMeshsDerivativesMatchDifferencesOfItsEnergy) {
  for (const auto [tangled, metric] : testing::kTreatments)
    for (const Target target : {Target::StraightSided, Target::Ideal, Target::Size, Target::Strain}) {
      if (metric && target != Target::Size) continue;
      prepare(tangled, metric);
      TargetField values;
      if (target == Target::Size || target == Target::Strain)
        values.values.assign(mesh_.element_count(mesh_.dimension), target == Target::Size ? 0.4 : 0.1);
      if (!metric) set_target(target, values);
      sweeper_->rebuild();
      sweeper_->scan();
      testing::WholeMesh whole(problem_, *plain_);
      const std::vector<double> direction = testing::random_direction(problem_, 11);
      const double h = 1e-5;
      const double difference = (8 * (whole.energy(direction, h) - whole.energy(direction, -h)) -
                                 (whole.energy(direction, 2 * h) - whole.energy(direction, -2 * h))) /
                                (12 * h);
      const std::vector<double> gradient = whole.gradient(*fast_);
      double slope = 0, size = 0;
      for (std::size_t i = 0; i < gradient.size(); ++i) {
        slope += gradient[i] * direction[i];
        size += std::abs(gradient[i] * direction[i]);
      }
      EXPECT_NEAR(slope, difference, 1e-6 * size)
          << "target " << static_cast<int>(target) << (metric ? ", metric" : "");
    }
}

}  // namespace
}  // namespace varimesh
