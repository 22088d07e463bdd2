// The second derivatives of the whole mesh's energy: F to 16 bits, node blocks, and products with a direction.
#include <gtest/gtest.h>

#include <cmath>

#include "core/kernels/hessian/batches.h"
#include "core/kernels/node_star.h"
#include "tests/core/support/kernel_cases.h"

namespace varimesh {
namespace {

using testing::Filling;

class HessianKernelsOf : public testing::KernelCases {};

INSTANTIATE_TEST_SUITE_P(Materials, HessianKernelsOf, ::testing::ValuesIn(testing::every_kernel_case()),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(HessianKernelsOf, DeformationIsKeptTo16BitsOfItsDifferences) {
  for (const auto [tangled, metric] : testing::kTreatments) {
    prepare(tangled, metric);
    const int d = problem_.dimension;
    const auto hessian = make_hessian_kernels(GetParam().material.material, d);
    for (BatchSet& set : make_batches(problem_, *hessian))
      for (std::int32_t cell = 0; cell < set.cells->count; ++cell) {
        const CellSet& cells = *set.cells;
        const std::int32_t b = cell / kBatch, lane = cell % kBatch;
        hessian->linearise(set, b, cells.deformation_of(b * kBatch));
        const float* mean = set.mean.data() + std::size_t(b) * (d * d + 1) * kBatch + lane;
        const std::int16_t* steps = set.deformation.data() + b * set.deformation_size() + lane;
        const double step = mean[d * d * kBatch];
        double largest = 0;
        for (int entry = 0; entry < d * d; ++entry)
          for (int q = 0; q < cells.points; ++q) {
            const double F = cells.deformation_of(cell)[entry * cells.stride + q], middle = mean[entry * kBatch];
            const double kept = middle + step * steps[(set.gradient.slots[q] * d * d + entry) * kBatch];
            EXPECT_LE(std::abs(kept - F), 0.5001 * step);
            largest = std::max(largest, std::abs(F - middle));
          }
        EXPECT_NEAR(step * 32767, largest, 1e-6 * largest);
      }
  }
}

// A node's gradient and its own block of the Hessian, added up from its cells as Newton's method does it.
//
// F is kept to 16 bits of its difference from the mean. The block's error is 1.5e-5 of that difference, times the
// energy's third derivatives over its second ones. In a tangled mesh J is close to zero in places, and the third
// derivatives are large.
TEST_P(HessianKernelsOf, CellsPartsAddUpToTheirNodesExpansions) {
  for (const auto [tangled, metric] : testing::kTreatments) {
    prepare(tangled, metric);
    const int d = problem_.dimension;
    const auto hessian = make_hessian_kernels(GetParam().material.material, d);
    std::vector<BatchSet> batches = make_batches(problem_, *hessian);
    std::vector<StarExpansion> sums(problem_.free.size());
    const auto add_up = [&](auto add) {
      for (std::size_t rank = 0; rank < sums.size(); ++rank)
        for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
          const Incidence& at = problem_.incidences[i];
          const BatchSet& set = batches[at.set];
          add(sums[rank], set.contributions.data() + set.contribution_index(at.cell, at.local, 2 * d));
        }
    };
    for (BatchSet& set : batches)
      for (std::int32_t b = 0; b < set.count; ++b) hessian->linearise(set, b, set.cells->deformation_of(b * kBatch));
    add_up([d](StarExpansion& sum, const float* part) {
      for (int k = 0; k < d; ++k) sum.gradient[k] += double(part[k]) + part[d + k];
    });
    for (BatchSet& set : batches)
      for (std::int32_t b = 0; b < set.count; ++b) hessian->node_blocks(set, b);
    add_up([d](StarExpansion& sum, const float* part) {
      for (int entry = 0; entry < d * (d + 1) / 2; ++entry) sum.hessian[entry] += part[entry];
    });
    for (std::size_t rank = 0; rank < sums.size(); ++rank) {
      const StarExpansion plain = plain_->expand(NodeStar(problem_, std::int32_t(rank)).cells());
      double gradient = 0, size = 0;
      for (const double g : plain.gradient) gradient = std::max(gradient, std::abs(g));
      for (const double h : plain.hessian) size = std::max(size, std::abs(h));
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(sums[rank].gradient[i], plain.gradient[i], 1e-10 * (gradient + 0.01 * size));
      for (int i = 0; i < 6; ++i)
        EXPECT_NEAR(sums[rank].hessian[i], plain.hessian[i], (tangled ? 2.5e-3 : 4e-5) * size);
    }
  }
}

TEST_P(HessianKernelsOf, GradientHasTheBitsOfLinearise) {
  for (const auto [tangled, metric] : testing::kTreatments) {
    prepare(tangled, metric);
    const int d = problem_.dimension;
    const auto hessian = make_hessian_kernels(GetParam().material.material, d);
    for (CellSet& cells : problem_.sets) {
      cells.energy_slope.resize(cells.count);
      for (std::int32_t cell = 0; cell < cells.count; ++cell) cells.energy_slope[cell] = 0.5 + 0.01 * cell;
    }
    std::vector<BatchSet> linearised = make_batches(problem_, *hessian), batches = make_batches(problem_, *hessian);
    for (std::size_t s = 0; s < batches.size(); ++s) {
      const CellSet& cells = *batches[s].cells;
      for (std::int32_t b = 0; b < batches[s].count; ++b) {
        hessian->linearise(linearised[s], b, cells.deformation_of(b * kBatch));
        hessian->gradient(batches[s], b, cells.deformation_of(b * kBatch));
      }
      for (std::int32_t cell = 0; cell < cells.count; ++cell)
        for (int n = 0; n < cells.nodes_per_cell; ++n)
          for (int k = 0; k < 2 * d; ++k) {
            const std::size_t number = batches[s].contribution_index(cell, n, 2 * d) + k;
            EXPECT_EQ(batches[s].contributions[number], linearised[s].contributions[number]);
          }
    }
  }
}

TEST_P(HessianKernelsOf, ProductsMatchDifferencesOfTheGradient) {
  for (const auto [tangled, metric] : testing::kTreatments) {
    prepare(tangled, metric);
    testing::WholeMesh whole(problem_, *plain_);
    const std::vector<double> direction = testing::random_direction(problem_, 13);
    const double h = 1e-5;
    std::vector<double> expected(direction.size());
    for (const auto& [steps, weight] : {std::pair{1, 8.0}, {-1, -8.0}, {2, -1.0}, {-2, 1.0}}) {
      const std::vector<double> g = whole.gradient_at(direction, steps * h, *fast_);
      for (std::size_t i = 0; i < g.size(); ++i) expected[i] += weight * g[i] / (12 * h);
    }
    const auto hessian = make_hessian_kernels(GetParam().material.material, problem_.dimension);
    const std::vector<double> product = whole.product(*hessian, direction);
    double error = 0, size = 0;
    for (std::size_t i = 0; i < product.size(); ++i) {
      error += std::pow(product[i] - expected[i], 2);
      size += std::pow(expected[i], 2);
    }
    EXPECT_LE(std::sqrt(error / size), tangled ? 4e-4 : 2e-5);
  }
}

TEST(Products, DoNotDependOnWhatTheThreadDidBefore) {
  const auto product = [](int order, double size) {
    Problem problem = testing::make_problem(testing::grid(Filling::Tetrahedra, {2, 2, 2}, order));
    const auto plain = make_plain_kernels(material(Options{}), 3);
    hold_deformation(problem, false);
    for (CellSet& set : problem.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) plain->rebuild(set, cell, problem.positions);
    std::vector<double> direction = testing::random_direction(problem, 3);
    for (double& number : direction) number *= size;
    testing::WholeMesh whole(problem, *plain);
    return whole.product(*make_hessian_kernels(material(Options{}), 3), direction);
  };
  const std::vector<double> first = product(1, 1);
  product(4, 1e6);
  EXPECT_EQ(product(1, 1), first);
}

}  // namespace
}  // namespace varimesh
