// The preconditioner's vectorised loops against plain ones.
#include "core/preconditioner/coarse_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/base/index.h"
#include "core/energy/material.h"
#include "core/kernels/hessian/fixed_point_16.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

/// A random matrix of blocks, with a right-hand side and an x.
struct RandomRows {
  int d;
  std::int32_t count = 23;
  std::vector<std::int64_t> begin{0};
  std::vector<std::int32_t> column;
  std::vector<std::int16_t> entry;
  AlignedVector<float> right, x, residual;

  explicit RandomRows(int dimension) : d(dimension) {
    std::mt19937 random(static_cast<unsigned>(d));
    std::uniform_int_distribution<int> steps(-32767, 32767), dice(0, 2);
    std::uniform_real_distribution<float> uniform(-1, 1);
    for (std::int32_t i = 0; i < count; ++i) {
      for (std::int32_t j = 0; j < count; ++j)
        if (j != i && dice(random) == 0) column.push_back(j);
      begin.push_back(static_cast<std::int64_t>(column.size()));
    }
    for (std::size_t e = 0; e < column.size() * at(d * d) + 1; ++e)
      entry.push_back(static_cast<std::int16_t>(steps(random)));
    for (AlignedVector<float>* vector : {&right, &x, &residual}) {
      vector->resize(at(count * padded(d)));
      for (float& number : *vector) number = uniform(random);
    }
  }

  BlockRows rows() { return {begin.data(), column.data(), entry.data(), right.data(), x.data(), residual.data()}; }

  /// Σ K_ij x_j over the columns j of row i with j in [from, to), component k.
  double product(std::int32_t i, int k, std::int32_t from, std::int32_t to) const {
    double sum = 0;
    for (std::int64_t e = begin[at(i)]; e < begin[at(i) + 1]; ++e) {
      const std::int32_t j = column[at(e)];
      if (j < from || j >= to) continue;
      for (int l = 0; l < d; ++l)
        sum += double(entry[at((e * d + l) * d + k)]) / kLargestFixedPoint * x[at(j * padded(d) + l)];
    }
    return sum;
  }
};

class CoarseKernelsIn : public ::testing::TestWithParam<int> {
 protected:
  RandomRows matrix_{GetParam()};
  std::unique_ptr<CoarseKernels> kernels_ = make_coarse_kernels(GetParam());
};

INSTANTIATE_TEST_SUITE_P(Dimensions, CoarseKernelsIn, ::testing::Values(2, 3),
                         [](const auto& info) { return std::to_string(info.param) + "D"; });

TEST_P(CoarseKernelsIn, GoForwardThroughTheLowerTriangle) {
  for (std::int32_t i = 0; i < matrix_.count; ++i) {
    const RandomRows before = matrix_;
    kernels_->forward(matrix_.rows(), i, i + 1);
    for (int k = 0; k < GetParam(); ++k) {
      const std::size_t place = at(i * padded(GetParam()) + k);
      EXPECT_NEAR(matrix_.x[place], before.right[place] - before.product(i, k, 0, i), 2e-5);
    }
  }
}

TEST_P(CoarseKernelsIn, TakeTheResidualFromTheUpperTriangle) {
  const RandomRows before = matrix_;
  kernels_->residual(matrix_.rows(), 0, matrix_.count);
  for (std::int32_t i = 0; i < matrix_.count; ++i)
    for (int k = 0; k < GetParam(); ++k)
      EXPECT_NEAR(matrix_.residual[at(i * padded(GetParam()) + k)], -before.product(i, k, i, matrix_.count), 2e-5);
}

TEST_P(CoarseKernelsIn, GoBackwardThroughTheWholeRow) {
  for (std::int32_t i = matrix_.count; i-- > 0;) {
    const RandomRows before = matrix_;
    kernels_->backward(matrix_.rows(), i, i + 1);
    for (int k = 0; k < GetParam(); ++k) {
      const std::size_t place = at(i * padded(GetParam()) + k);
      EXPECT_NEAR(matrix_.x[place], before.right[place] - before.product(i, k, 0, matrix_.count), 2e-5);
    }
  }
}

/// Loops over the cells of a mesh.
class CoarseKernelsOn : public ::testing::TestWithParam<Filling> {
 protected:
  CoarseKernelsOn() : problem_(testing::make_problem(testing::grid(GetParam(), {3, 3, 2}, 3))) {
    const int d = problem_.dimension;
    kernels_ = make_coarse_kernels(d);
    batches_ = make_batches(problem_, *make_hessian_kernels(material(Options{}), d));
    space_ = coarse_space(problem_, 2, Team(1));
    std::mt19937 random(3);
    std::uniform_real_distribution<float> uniform(-1, 1);
    values_.resize(problem_.free.size() * at(d));
    for (float& value : values_) value = uniform(random);
    values_.resize(values_.size() + at(padded(d)));  // zeros, for fixed nodes
    coarse_.resize(at(space_.count * padded(d)));
    for (float& value : coarse_) value = uniform(random);
  }

  Problem problem_;
  std::vector<BatchSet> batches_;
  CoarseSpace space_;
  std::unique_ptr<CoarseKernels> kernels_;
  std::vector<float> values_;
  AlignedVector<float> coarse_;
};

INSTANTIATE_TEST_SUITE_P(Fillings, CoarseKernelsOn, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(CoarseKernelsOn, RestrictEachCellsValuesToItsCoarseNodes) {
  const int d = problem_.dimension;
  std::vector<std::int32_t> rank(problem_.positions.size() / at(d), -1);
  for (std::size_t f = 0; f < problem_.free.size(); ++f) rank[at(problem_.free[f])] = static_cast<std::int32_t>(f);
  for (std::size_t s = 0; s < batches_.size(); ++s) {
    const CellSet& cells = problem_.sets[s];
    const CoarseSpace::Set& coarse = space_.sets[s];
    const SparseRows to_coarse = transposed(coarse.values, coarse.nodes_per_cell);
    for (std::int32_t b = 0; b < batches_[s].count; ++b)
      kernels_->restrict_cells(batches_[s], b, to_coarse, values_.data());
    for (std::int32_t cell = 0; cell < cells.count; ++cell) {
      std::vector<double> expected(at(coarse.nodes_per_cell * d), 0.0);
      for (int n = 0; n < cells.nodes_per_cell; ++n) {
        const std::int32_t node = rank[at(cells.nodes[at(cell * cells.nodes_per_cell + n)])];
        for (std::int64_t e = coarse.values.begin[at(n)]; node >= 0 && e < coarse.values.begin[at(n) + 1]; ++e)
          for (int k = 0; k < d; ++k)
            expected[at(coarse.values.column[at(e)] * d + k)] +=
                double(coarse.values.factor[at(e)]) * values_[at(node * d + k)];
      }
      for (int a = 0; a < coarse.nodes_per_cell; ++a)
        for (int k = 0; k < d; ++k)
          EXPECT_NEAR(batches_[s].contributions[contribution_index(cell, a, at(coarse.nodes_per_cell), d) + at(k)],
                      expected[at(a * d + k)], 1e-5);
    }
  }
}

TEST_P(CoarseKernelsOn, AddNodeBlocksAndInterpolatedValues) {
  const int d = problem_.dimension;
  const auto nodes = static_cast<std::int32_t>(problem_.free.size());
  std::mt19937 random(4);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<float> blocks(at(nodes * triangle_size(d)));
  for (float& number : blocks) number = uniform(random);
  std::vector<float> z(values_.size());
  const double along =
      kernels_->precondition(problem_, space_, coarse_.data(), blocks.data(), values_.data(), z.data(), 0, nodes);
  double expected_along = 0;
  for (std::int32_t i = 0; i < nodes; ++i) {
    const Incidence& first = problem_.incidences[at(problem_.offsets[at(i)])];
    const CoarseSpace::Set& set = space_.sets[at(first.set)];
    for (int k = 0; k < d; ++k) {
      double expected = 0;
      for (int l = 0; l < d; ++l)
        expected += double(blocks[at(i * triangle_size(d) + symmetric_index(k, l))]) * values_[at(i * d + l)];
      for (std::int64_t e = set.values.begin[at(first.local)]; e < set.values.begin[at(first.local) + 1]; ++e) {
        const std::int32_t node = set.nodes[at(first.cell * set.nodes_per_cell + set.values.column[at(e)])];
        if (node >= 0) expected += double(set.values.factor[at(e)]) * coarse_[at(node * padded(d) + k)];
      }
      EXPECT_NEAR(z[at(i * d + k)], expected, 1e-5);
      expected_along += expected * values_[at(i * d + k)];
    }
  }
  EXPECT_NEAR(along, expected_along, 1e-4);
}

TEST_P(CoarseKernelsOn, AddUpThePartsOfEachCoarseNode) {
  const int d = problem_.dimension;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (BatchSet& set : batches_)
    for (float& part : set.contributions) part = uniform(random);
  // The cells of each coarse node, and a block for each.
  std::vector<std::vector<Incidence>> cells(at(space_.count));
  for (std::size_t s = 0; s < space_.sets.size(); ++s)
    for (std::size_t i = 0; i < space_.sets[s].nodes.size(); ++i) {
      const auto per_cell = at(space_.sets[s].nodes_per_cell);
      if (space_.sets[s].nodes[i] >= 0)
        cells[at(space_.sets[s].nodes[i])].push_back({static_cast<std::int32_t>(i / per_cell),
                                                      static_cast<std::int16_t>(s),
                                                      static_cast<std::int16_t>(i % per_cell)});
    }
  std::vector<std::int64_t> begin{0};
  std::vector<Incidence> places;
  for (const auto& of_node : cells) {
    places.insert(places.end(), of_node.begin(), of_node.end());
    begin.push_back(static_cast<std::int64_t>(places.size()));
  }
  std::vector<float> blocks(at(space_.count * d * d + 1));
  for (float& number : blocks) number = uniform(random);
  AlignedVector<float> to(at(space_.count * padded(d)));
  kernels_->add_up(contributions_of(batches_, [&](std::size_t s) { return space_.sets[s].nodes_per_cell; }),
                   begin.data(), places.data(), blocks.data(), to.data(), 0, space_.count);
  for (std::int32_t i = 0; i < space_.count; ++i) {
    std::vector<double> sum(at(d), 0.0);
    for (const Incidence& place : cells[at(i)])
      for (int k = 0; k < d; ++k)
        sum[at(k)] +=
            batches_[at(place.set)].contributions[contribution_index(place.cell, place.local,
                                                                     at(space_.sets[at(place.set)].nodes_per_cell), d) +
                                                  at(k)];
    for (int k = 0; k < d; ++k) {
      double expected = 0;
      for (int l = 0; l < d; ++l) expected += double(blocks[at((i * d + l) * d + k)]) * sum[at(l)];
      EXPECT_NEAR(to[at(i * padded(d) + k)], expected, 1e-5);
    }
  }
}

}  // namespace
}  // namespace varimesh
