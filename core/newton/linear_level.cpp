#include "core/newton/linear_level.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/aligned.h"
#include "core/base/index.h"
#include "core/hessian/batches.h"
#include "core/reference/basis.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNodesPerTask = 128;
constexpr double kLeastPivot = 1e-14;  // relative to the largest entry

/// Values of functions of order 1 at the nodes of the space above; only free nodes on either side.
SparseRows values_above(const Problem& problem, const CoarseSpace& above, const CoarseSpace& linear) {
  std::vector<std::vector<std::pair<std::int32_t, float>>> rows(above.count);
  for (std::size_t b = 0; b < problem.sets.size(); ++b) {
    const Shape shape = problem.sets[b].shape;
    const CoarseSpace::Set &fine = above.sets[b], &coarse = linear.sets[b];
    const Eigen::MatrixXd values = reference::basis_values(
        shape, 1, reference::NodeSet::Equispaced, problem.dimension,
        reference::nodes(shape, above.order, reference::NodeSet::Equispaced, problem.dimension));
    for (std::int32_t cell = 0; cell < problem.sets[b].count; ++cell)
      for (int n = 0; n < fine.nodes_per_cell; ++n) {
        const std::int32_t node = fine.nodes[static_cast<std::size_t>(cell) * fine.nodes_per_cell + n];
        if (node < 0 || !rows[node].empty()) continue;
        for (int v = 0; v < coarse.nodes_per_cell; ++v) {
          const std::int32_t vertex = coarse.nodes[static_cast<std::size_t>(cell) * coarse.nodes_per_cell + v];
          if (vertex >= 0 && std::abs(values(n, v)) > 1e-12)
            rows[node].emplace_back(vertex, static_cast<float>(values(n, v)));
        }
      }
  }
  SparseRows out;
  out.begin.push_back(0);
  for (const auto& row : rows) {
    for (const auto& [column, factor] : row) {
      out.column.push_back(column);
      out.factor.push_back(factor);
    }
    out.begin.push_back(static_cast<std::int64_t>(out.column.size()));
  }
  return out;
}

}  // namespace

LinearLevel::LinearLevel(const Problem& problem, const CoarseSpace& above, const Team& team)
    : problem_(problem),
      team_(team),
      space_(coarse_space(problem, 1)),
      to_above_(values_above(problem, above, space_)),
      from_above_(transposed(to_above_, space_.count)),
      solver_(team),
      is_used_(space_.count > 0),
      right_(space_.count, problem.dimension) {}

template <class Body>
void LinearLevel::for_pairs(const Body& body) const {
  for (std::size_t b = 0; b < space_.sets.size(); ++b) {
    const CoarseSpace::Set& set = space_.sets[b];
    const int n = set.nodes_per_cell;
    for (std::int32_t cell = 0; cell < problem_.sets[b].count; ++cell) {
      const std::int32_t* nodes = set.nodes.data() + static_cast<std::size_t>(cell) * n;
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j)
          if (nodes[j] >= 0 && nodes[i] >= nodes[j]) body(b, cell, i, j, nodes[i], nodes[j]);
    }
  }
}

void LinearLevel::find_pattern() {
  matrix_.resize(space_.count, space_.count);
  {
    std::vector<Eigen::Triplet<double>> entries;
    for_pairs([&](std::size_t, std::int32_t, int, int, std::int32_t row, std::int32_t column) {
      entries.emplace_back(row, column, 0.0);
    });
    matrix_.setFromTriplets(entries.begin(), entries.end());
  }
  solver_.analyse(matrix_);
}

template <int d>
void LinearLevel::assemble_from(const std::vector<std::vector<float>>& tensors) {
  if (matrix_.nonZeros() == 0) find_pattern();
  matrix_.coeffs().setZero();
  for_pairs([&](std::size_t b, std::int32_t cell, int i, int j, std::int32_t row, std::int32_t column) {
    const CoarseSpace::Set& set = space_.sets[b];
    const float* means = set.stiffness.data() + (static_cast<std::size_t>(i) * set.nodes_per_cell + j) * d * d;
    const float* M = tensors[b].data() + static_cast<std::size_t>(cell) * tensor_size(d);
    double sum = 0;  // Σ M(m m, k l) means(k l), also over the directions m
    for (int m = 0; m < d; ++m)
      for (int k = 0; k < d; ++k)
        for (int l = 0; l < d; ++l) {
          const int mk = m * d + std::max(k, l), ml = m * d + std::min(k, l);
          sum += static_cast<double>(M[lower_index(mk, ml)]) * means[k * d + l];
        }
    matrix_.coeffRef(row, column) += sum / d * (i == j ? 1 + 1e-6 : 1.0);
  });
  // The p-norm may leave the cells of a vertex almost no weight; the factor needs a pivot all the same.
  const double largest = matrix_.coeffs().maxCoeff();
  for (std::int32_t vertex = 0; vertex < space_.count; ++vertex)
    matrix_.coeffRef(vertex, vertex) += kLeastPivot * largest;
  if (!solver_.factorise(matrix_)) is_used_ = false;
}

void LinearLevel::assemble(const std::vector<std::vector<float>>& tensors) {
  problem_.dimension == 2 ? assemble_from<2>(tensors) : assemble_from<3>(tensors);
}

template <int d>
void LinearLevel::restrict_residual(const float* residual) {
  constexpr std::size_t kStride = padded(d);
  team_.for_each(space_.count, kNodesPerTask, [&](std::int32_t vertex) {
    std::array<double, 3> sum{};
    for (std::int64_t i = from_above_.begin[vertex]; i < from_above_.begin[vertex + 1]; ++i)
      for (int k = 0; k < d; ++k) sum[k] += from_above_.factor[i] * residual[from_above_.column[i] * kStride + k];
    for (int k = 0; k < d; ++k) right_(vertex, k) = sum[k];
  });
}

void LinearLevel::solve(const float* residual) {
  const int d = problem_.dimension;
  d == 2 ? restrict_residual<2>(residual) : restrict_residual<3>(residual);
  solver_.solve(right_, solution_);
}

}  // namespace varimesh
