#include "core/newton/coarse_level.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/index.h"
#include "core/hessian/fixed_point_16.h"
#include "core/reference/basis.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNodesPerTask = 128;  // of a colour, of which there are many small ones
constexpr double kNothing = 1e-34;           // blocks are about 1 at most; the inverse of less is no float
constexpr double kLeastPivot = 1e-14;        // of the largest
/// A bound of the matrix' size above which the coarse level is of order 1.
constexpr std::size_t kMostBytes = std::size_t{8} << 30;
/// Beyond so many linear nodes a sparse factor would take more memory and time than it saves.
constexpr std::int32_t kMostLinear = 200000;

/// v becomes L v or Lᵀ v, from L⁻¹; 0 where that is 0.
template <int d>
void times_factor(const Eigen::Matrix<float, d, d, Eigen::RowMajor>& inverse, float* v) {
  Eigen::Map<Eigen::Matrix<float, d, 1>> at(v);
  if (inverse(0, 0) == 0)
    at.setZero();
  else
    inverse.template triangularView<Eigen::Lower>().solveInPlace(at);
}
template <int d>
void times_factor_transposed(const Eigen::Matrix<float, d, d, Eigen::RowMajor>& inverse, float* v) {
  Eigen::Map<Eigen::Matrix<float, d, 1>> at(v);
  if (inverse(0, 0) == 0)
    at.setZero();
  else
    inverse.transpose().template triangularView<Eigen::Upper>().solveInPlace(at);
}

/// Values at order-2 nodes of functions of order 1, where both nodes are free.
SparseRows linear_to_quadratic(const Problem& problem, const CoarseSpace& quadratic, const CoarseSpace& linear) {
  std::vector<std::vector<std::pair<std::int32_t, float>>> rows(quadratic.count);
  for (std::size_t b = 0; b < problem.sets.size(); ++b) {
    const Shape shape = problem.sets[b].shape;
    const CoarseSpace::Set &fine = quadratic.sets[b], &coarse = linear.sets[b];
    const Eigen::MatrixXd values = reference::basis_values(
        shape, 1, reference::NodeSet::Equispaced, problem.dimension,
        reference::nodes(shape, quadratic.order, reference::NodeSet::Equispaced, problem.dimension));
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
    out.begin.push_back(static_cast<std::int32_t>(out.column.size()));
  }
  return out;
}

/// 2 where the mesh and the memory have room for it: a row of a hexahedral mesh has 125 blocks.
int coarse_order(const Problem& problem) {
  std::size_t bytes = 0;
  for (const CellSet& set : problem.sets) {
    const std::size_t nodes = reference::node_count(set.shape, 2);
    bytes += set.count * nodes * nodes * set.dimension * set.dimension * sizeof(std::int16_t);
    if (set.order < 2) return 1;
  }
  return bytes <= kMostBytes ? 2 : 1;
}

}  // namespace

CoarseLevel::CoarseLevel(const Problem& problem, std::vector<BatchSet>& batches, const Team& team)
    : problem_(problem),
      batches_(batches),
      team_(team),
      space_(coarse_space(problem, coarse_order(problem))),
      linear_(coarse_space(problem, 1)),
      kernels_(make_coarse_kernels(problem.dimension)) {
  for (const CellSet& set : problem.sets)
    tensors_.emplace_back(static_cast<std::size_t>(set.count) * tensor_size(set.dimension));
  colour();
  for (const CoarseSpace::Set& set : space_.sets) to_coarse_.push_back(transposed(set.values, set.nodes_per_cell));
  find_neighbours();
  from_linear_ = linear_to_quadratic(problem, space_, linear_);
  to_linear_ = transposed(from_linear_, linear_.count);
  const int d = problem.dimension;
  const std::size_t floats = static_cast<std::size_t>(space_.count) * padded(d);
  entry_.resize(column_.size() * d * d + 1);
  inverse_factor_.resize(static_cast<std::size_t>(space_.count) * d * d + 1);
  r_.resize(floats);
  x_.resize(floats);
  residual_.resize(floats);
  rows_ = {row_begin_.data(), column_.data(), entry_.data(), r_.data(), x_.data(), residual_.data()};
  solves_linear_ = linear_.count > 0 && linear_.count <= kMostLinear;
  linear_right_.resize(linear_.count, d);
}

void CoarseLevel::colour() {
  // The nodes of a cell all differ in colour: greedily, in the order in which the cells name them.
  std::vector<std::vector<std::int32_t>> cells(space_.count);
  std::vector<std::vector<std::int32_t>> used(problem_.cells);  // colours in each cell
  for (std::size_t b = 0; b < problem_.sets.size(); ++b) {
    const CoarseSpace::Set& set = space_.sets[b];
    for (std::size_t i = 0; i < set.nodes.size(); ++i)
      if (set.nodes[i] >= 0)
        cells[set.nodes[i]].push_back(problem_.sets[b].first + static_cast<std::int32_t>(i / set.nodes_per_cell));
  }
  std::vector<std::int32_t> colour_of(space_.count);
  std::vector<char> taken;
  std::int32_t count = 0;
  for (std::int32_t node = 0; node < space_.count; ++node) {
    taken.assign(count + 1, 0);
    for (const std::int32_t cell : cells[node])
      for (const std::int32_t colour : used[cell]) taken[colour] = 1;
    const auto colour = static_cast<std::int32_t>(std::find(taken.begin(), taken.end(), 0) - taken.begin());
    count = std::max(count, colour + 1);
    colour_of[node] = colour;
    for (const std::int32_t cell : cells[node]) used[cell].push_back(colour);
  }
  colours_.assign(count + 1, 0);
  for (const std::int32_t colour : colour_of) ++colours_[colour + 1];
  for (std::int32_t colour = 0; colour < count; ++colour) colours_[colour + 1] += colours_[colour];
  std::vector<std::int32_t> next(colours_.begin(), colours_.end() - 1), number(space_.count);
  for (std::int32_t node = 0; node < space_.count; ++node) number[node] = next[colour_of[node]]++;
  renumber(space_, number);
}

void CoarseLevel::find_neighbours() {
  places_begin_.assign(space_.count + 1, 0);
  for (const CoarseSpace::Set& set : space_.sets)
    for (const std::int32_t node : set.nodes)
      if (node >= 0) ++places_begin_[node + 1];
  for (std::int32_t node = 0; node < space_.count; ++node) places_begin_[node + 1] += places_begin_[node];
  places_.resize(places_begin_.back());
  std::vector<std::int32_t> next(places_begin_.begin(), places_begin_.end() - 1);
  for (std::size_t b = 0; b < space_.sets.size(); ++b) {
    const CoarseSpace::Set& set = space_.sets[b];
    for (std::size_t i = 0; i < set.nodes.size(); ++i)
      if (set.nodes[i] >= 0)
        places_[next[set.nodes[i]]++] = {static_cast<std::int32_t>(i / set.nodes_per_cell),
                                         static_cast<std::int16_t>(b),
                                         static_cast<std::int16_t>(i % set.nodes_per_cell)};
  }
  row_begin_.push_back(0);
  std::vector<std::int32_t> row;
  for (std::int32_t node = 0; node < space_.count; ++node) {
    row.clear();
    for (std::int32_t p = places_begin_[node]; p < places_begin_[node + 1]; ++p) {
      const CoarseSpace::Set& set = space_.sets[places_[p].set];
      const auto first = set.nodes.begin() + static_cast<std::ptrdiff_t>(places_[p].cell) * set.nodes_per_cell;
      std::copy_if(first, first + set.nodes_per_cell, std::back_inserter(row),
                   [node](std::int32_t n) { return n >= 0 && n != node; });
    }
    std::sort(row.begin(), row.end());
    column_.insert(column_.end(), row.begin(), std::unique(row.begin(), row.end()));
    row_begin_.push_back(static_cast<std::int64_t>(column_.size()));
  }
  column_.shrink_to_fit();
}

template <int d>
CoarseLevel::Tensor<d> CoarseLevel::tensor(std::size_t set, std::int32_t cell) const {
  const float* from = tensors_[set].data() + static_cast<std::size_t>(cell) * tensor_size(d);
  Tensor<d> M;
  for (int ik = 0; ik < d * d; ++ik)
    for (int jl = 0; jl <= ik; ++jl) {
      const int i = ik / d, k = ik % d, j = jl / d, l = jl % d;
      M(i * d + j, k * d + l) = M(j * d + i, l * d + k) = *from++;
    }
  return M;
}

template <int d>
CoarseLevel::BlockMatrix<d> CoarseLevel::stiffness(const Tensor<d>& M, const CoarseSpace::Set& set, int a, int b) {
  const Eigen::Map<const Eigen::Matrix<float, d * d, 1>> means(
      set.stiffness.data() + (static_cast<std::size_t>(a) * set.nodes_per_cell + b) * d * d);
  BlockMatrix<d> K;
  Eigen::Map<Eigen::Matrix<float, d * d, 1>>(K.data()) = M * means;
  return K;
}

template <int d>
void CoarseLevel::factorise_diagonal(std::int32_t node) {
  BlockMatrix<d> K = BlockMatrix<d>::Zero();
  for (std::int32_t p = places_begin_[node]; p < places_begin_[node + 1]; ++p) {
    const Incidence& at = places_[p];
    K += stiffness<d>(tensor<d>(at.set, at.cell), space_.sets[at.set], at.local, at.local);
  }
  Eigen::Matrix<double, d, d> D = K.template cast<double>();
  D.diagonal().array() += 1e-6 * D.trace();
  Eigen::Matrix<double, d, d> inverse = Eigen::Matrix<double, d, d>::Zero();
  if (D.norm() >= kNothing) {
    const Eigen::LLT<Eigen::Matrix<double, d, d>> factor(D);
    if (factor.info() == Eigen::Success) inverse = factor.matrixL().solve(Eigen::Matrix<double, d, d>::Identity());
    if (!inverse.allFinite()) inverse.setZero();
  }
  Eigen::Map<Eigen::Matrix<float, d, d>>(inverse_factor_.data() + static_cast<std::size_t>(node) * d * d) =
      inverse.template cast<float>();
}

template <int d>
void CoarseLevel::assemble_row(std::int32_t node) {
  const auto begin = column_.begin() + row_begin_[node], end = column_.begin() + row_begin_[node + 1];
  static thread_local std::vector<BlockMatrix<d>> row;
  row.assign(end - begin, BlockMatrix<d>::Zero());
  for (std::int32_t p = places_begin_[node]; p < places_begin_[node + 1]; ++p) {
    const Incidence& at = places_[p];
    const CoarseSpace::Set& set = space_.sets[at.set];
    const Tensor<d> M = tensor<d>(at.set, at.cell);
    const std::int32_t* nodes = set.nodes.data() + static_cast<std::size_t>(at.cell) * set.nodes_per_cell;
    for (int b = 0; b < set.nodes_per_cell; ++b)
      if (nodes[b] >= 0 && nodes[b] != node)
        row[std::lower_bound(begin, end, nodes[b]) - begin] += stiffness<d>(M, set, at.local, b);
  }
  const BlockMatrix<d> own = kLargestFixedPoint * inverse_factor<d>(node);
  std::int16_t* to = entry_.data() + row_begin_[node] * d * d;
  for (std::size_t e = 0; e < row.size(); ++e) {
    const BlockMatrix<d> scaled = own * row[e] * inverse_factor<d>(begin[static_cast<std::ptrdiff_t>(e)]).transpose();
    for (int j = 0; j < d; ++j)
      for (int i = 0; i < d; ++i) *to++ = to_fixed_point(scaled(i, j));
  }
}

template <int d>
CoarseLevel::BlockMatrix<d> CoarseLevel::inverse_factor(std::int32_t node) const {
  return Eigen::Map<const Eigen::Matrix<float, d, d>>(inverse_factor_.data() + static_cast<std::size_t>(node) * d * d);
}

template <class Body>
void CoarseLevel::for_linear_pairs(const Body& body) const {
  for (std::size_t b = 0; b < linear_.sets.size(); ++b) {
    const CoarseSpace::Set& set = linear_.sets[b];
    const int n = set.nodes_per_cell;
    for (std::int32_t cell = 0; cell < problem_.sets[b].count; ++cell) {
      const std::int32_t* nodes = set.nodes.data() + static_cast<std::size_t>(cell) * n;
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j)
          if (nodes[j] >= 0 && nodes[i] >= nodes[j]) body(b, cell, i, j, nodes[i], nodes[j]);
    }
  }
}

void CoarseLevel::find_linear_pattern() {
  linear_matrix_.resize(linear_.count, linear_.count);
  {
    std::vector<Eigen::Triplet<double>> entries;
    for_linear_pairs([&](std::size_t, std::int32_t, int, int, std::int32_t row, std::int32_t column) {
      entries.emplace_back(row, column, 0.0);
    });
    linear_matrix_.setFromTriplets(entries.begin(), entries.end());
  }
  factor_.analyzePattern(linear_matrix_);
}

template <int d>
void CoarseLevel::assemble_linear() {
  if (linear_matrix_.nonZeros() == 0) find_linear_pattern();
  linear_matrix_.coeffs().setZero();
  for_linear_pairs([&](std::size_t b, std::int32_t cell, int i, int j, std::int32_t row, std::int32_t column) {
    const CoarseSpace::Set& set = linear_.sets[b];
    const float* means = set.stiffness.data() + (static_cast<std::size_t>(i) * set.nodes_per_cell + j) * d * d;
    const float* M = tensors_[b].data() + static_cast<std::size_t>(cell) * tensor_size(d);
    double sum = 0;  // over the directions m of Σ M(m m, k l) means(k l)
    for (int m = 0; m < d; ++m)
      for (int k = 0; k < d; ++k)
        for (int l = 0; l < d; ++l) {
          const int mk = m * d + std::max(k, l), ml = m * d + std::min(k, l);
          sum += static_cast<double>(M[lower_index(mk, ml)]) * means[k * d + l];
        }
    linear_matrix_.coeffRef(row, column) += sum / d * (i == j ? 1 + 1e-6 : 1.0);
  });
  // Where the p-norm makes next to nothing of a vertex's cells, the factor still needs a pivot.
  const double largest = linear_matrix_.coeffs().maxCoeff();
  for (std::int32_t vertex = 0; vertex < linear_.count; ++vertex)
    linear_matrix_.coeffRef(vertex, vertex) += kLeastPivot * largest;
  factor_.factorize(linear_matrix_);
  if (factor_.info() != Eigen::Success) solves_linear_ = false;
}

void CoarseLevel::assemble(const HessianKernels& hessian) {
  if (space_.count == 0) return;
  for (std::size_t b = 0; b < batches_.size(); ++b)
    team_.for_each(batches_[b].count, 4,
                   [&](std::int32_t batch) { hessian.mean_tensors(batches_[b], batch, tensors_[b]); });
  make_matrix();
}

void CoarseLevel::make_matrix() {
  if (space_.count == 0) return;
  const int d = problem_.dimension;
  team_.for_each(space_.count, kNodesPerTask / 4,
                 [&](std::int32_t node) { d == 2 ? factorise_diagonal<2>(node) : factorise_diagonal<3>(node); });
  team_.for_each(space_.count, kNodesPerTask / 4,
                 [&](std::int32_t node) { d == 2 ? assemble_row<2>(node) : assemble_row<3>(node); });
  if (solves_linear_) d == 2 ? assemble_linear<2>() : assemble_linear<3>();
}

template <class Body>
void CoarseLevel::for_nodes(std::int32_t begin, std::int32_t end, const Body& body) const {
  team_.for_each((end - begin + kNodesPerTask - 1) / kNodesPerTask, 1, [&](std::int32_t task) {
    const std::int32_t first = begin + task * kNodesPerTask;
    body(first, std::min(end, first + kNodesPerTask));
  });
}

template <int d>
void CoarseLevel::correct_linear() {
  constexpr std::size_t kStride = padded(d);
  for_nodes(0, space_.count, [&](std::int32_t first, std::int32_t last) {
    kernels_->residual(rows_, first, last);
    for (std::int32_t node = first; node < last; ++node)  // L_i times it
      times_factor<d>(inverse_factor<d>(node), &residual_[node * kStride]);
  });
  team_.for_each(linear_.count, kNodesPerTask, [&](std::int32_t vertex) {
    std::array<double, 3> sum{};
    for (std::int32_t i = to_linear_.begin[vertex]; i < to_linear_.begin[vertex + 1]; ++i)
      for (int k = 0; k < d; ++k) sum[k] += to_linear_.factor[i] * residual_[to_linear_.column[i] * kStride + k];
    for (int k = 0; k < d; ++k) linear_right_(vertex, k) = sum[k];
  });
  linear_left_.resize(linear_.count, d);
  team_.for_each(d, 1, [&](std::int32_t k) { linear_left_.col(k) = factor_.solve(linear_right_.col(k)); });
  for_nodes(0, space_.count, [&](std::int32_t first, std::int32_t last) {
    for (std::int32_t node = first; node < last; ++node) {
      std::array<float, d> correction{};
      for (std::int32_t i = from_linear_.begin[node]; i < from_linear_.begin[node + 1]; ++i)
        for (int k = 0; k < d; ++k)
          correction[k] += static_cast<float>(from_linear_.factor[i] * linear_left_(from_linear_.column[i], k));
      times_factor_transposed<d>(inverse_factor<d>(node), correction.data());  // L_iᵀ times it
      for (int k = 0; k < d; ++k) x_[node * kStride + k] += correction[k];
    }
  });
}

template <int d>
void CoarseLevel::unscale() {
  for_nodes(0, space_.count, [&](std::int32_t first, std::int32_t last) {
    for (std::int32_t node = first; node < last; ++node) {
      Eigen::Map<Eigen::Matrix<float, d, 1>> x(&x_[static_cast<std::size_t>(node) * padded(d)]);
      x = inverse_factor<d>(node).transpose() * x.eval();
    }
  });
}

void CoarseLevel::solve(std::span<const float> shared) {
  if (space_.count == 0) return;
  for (std::size_t b = 0; b < batches_.size(); ++b)
    team_.for_each(batches_[b].count, 4, [&](std::int32_t batch) {
      kernels_->restrict_cells(batches_[b], batch, to_coarse_[b], shared.data());
    });
  const auto parts = parts_of(batches_, [&](std::size_t b) { return space_.sets[b].nodes_per_cell; });
  for_nodes(0, space_.count, [&](std::int32_t first, std::int32_t last) {
    kernels_->add_up(parts, places_begin_.data(), places_.data(), inverse_factor_.data(), r_.data(), first, last);
  });
  // From zero: what comes later counts for nothing yet.
  for (std::size_t colour = 0; colour + 1 < colours_.size(); ++colour)
    for_nodes(colours_[colour], colours_[colour + 1],
              [&](std::int32_t first, std::int32_t last) { kernels_->forward(rows_, first, last); });
  const int d = problem_.dimension;
  if (solves_linear_) d == 2 ? correct_linear<2>() : correct_linear<3>();
  for (std::size_t colour = colours_.size() - 1; colour-- > 0;)
    for_nodes(colours_[colour], colours_[colour + 1],
              [&](std::int32_t first, std::int32_t last) { kernels_->backward(rows_, first, last); });
  d == 2 ? unscale<2>() : unscale<3>();
}

}  // namespace varimesh
