#include "core/preconditioner/coarse_level.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/index.h"
#include "core/kernels/hessian/fixed_point_16.h"
#include "core/problem/clusters/first_fit.h"
#include "core/reference/basis.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNodesPerTask = 128;     // small, since there are many small colours
constexpr std::int32_t kNodesPerChunk = 16384;  // that are coloured together
constexpr std::size_t kFloatsPerTask = 16384;
constexpr double kNothing = 1e-34;  // blocks are at most about 1; the inverse of a smaller one may not fit a float

/// Replaces v by L v, given L⁻¹; by 0 if that is 0.
template <int d>
void times_factor(const Eigen::Matrix<float, d, d, Eigen::RowMajor>& inverse, float* v) {
  Eigen::Map<Eigen::Matrix<float, d, 1>> at(v);
  if (inverse(0, 0) == 0)
    at.setZero();
  else
    inverse.template triangularView<Eigen::Lower>().solveInPlace(at);
}
/// The same for Lᵀ v.
template <int d>
void times_factor_transposed(const Eigen::Matrix<float, d, d, Eigen::RowMajor>& inverse, float* v) {
  Eigen::Map<Eigen::Matrix<float, d, 1>> at(v);
  if (inverse(0, 0) == 0)
    at.setZero();
  else
    inverse.transpose().template triangularView<Eigen::Upper>().solveInPlace(at);
}

/// 2 if the mesh has that order. The matrix of hexahedra has 125 blocks per row, which takes 12 KiB per element.
int coarse_order(const Problem& problem) {
  const bool is_linear =
      std::any_of(problem.sets.begin(), problem.sets.end(), [](const CellSet& set) { return set.order < 2; });
  return is_linear ? 1 : 2;
}

/// Colours the nodes so that those of a cell all differ, and renumbers them by colour. Returns colours + 1 numbers:
/// where each colour's nodes begin.
std::vector<std::int32_t> colour_nodes(const Problem& problem, CoarseSpace& space, const Team& team) {
  const NodeCells cells = node_cells(space, team);
  const auto for_cells_of = [&](std::int32_t node, const auto& use) {
    for (std::int64_t p = cells.begin[at(node)]; p < cells.begin[at(node) + 1]; ++p)
      use(problem.sets[at(cells.incidences[at(p)].set)].first + cells.incidences[at(p)].cell);
  };
  const auto for_nodes_of = [&](std::int32_t cell, const auto& use) {
    std::size_t s = problem.sets.size() - 1;
    while (problem.sets[s].first > cell) --s;
    const CoarseSpace::Set& set = space.sets[s];
    const std::int32_t* nodes = set.nodes.data() + at(cell - problem.sets[s].first) * at(set.nodes_per_cell);
    for (int n = 0; n < set.nodes_per_cell; ++n)
      if (nodes[n] >= 0) use(nodes[n]);
  };
  const FirstFitSizes sizes{space.count, problem.cells, kNodesPerChunk};
  ColourPlaces places = sort_by_colour(first_fit(sizes, for_cells_of, for_nodes_of, team), team);
  renumber(space, places.place, team);
  return std::move(places.begin);
}

}  // namespace

CoarseLevel::Tables CoarseLevel::tables_of(const Problem& whole, const Team& team) {
  Tables tables;
  tables.space = coarse_space(whole, coarse_order(whole), team);
  tables.colours = colour_nodes(whole, tables.space, team);
  tables.cells = node_cells(tables.space, team);
  return tables;
}

CoarseLevel::CoarseLevel(const Problem& problem, std::vector<BatchSet>& batches, const Team& team,
                         const ProblemPart* part)
    : CoarseLevel(problem, batches, team, part, tables_of(part != nullptr ? *part->whole : problem, team)) {}

CoarseLevel::CoarseLevel(const Problem& problem, std::vector<BatchSet>& batches, const Team& team,
                         const ProblemPart* part, Tables tables)
    : problem_(problem),
      batches_(batches),
      team_(team),
      part_(part),
      space_(std::move(tables.space)),
      colours_(std::move(tables.colours)),
      cells_(std::move(tables.cells)),
      linear_(part != nullptr ? *part->whole : problem, space_, cells_, team, part),
      kernels_(make_coarse_kernels(problem.dimension)) {
  if (part != nullptr) take_part(*part);
  pattern_ = node_pattern(space_, cells_, false, team);
  for (std::size_t s = 0; s < problem.sets.size(); ++s)
    tensors_.emplace_back((part != nullptr ? part->cells[s].size() : at(problem.sets[s].count)) *
                          at(tensor_size(problem.dimension)));
  for (const CoarseSpace::Set& set : space_.sets) to_coarse_.push_back(transposed(set.values, set.nodes_per_cell));
  make_vectors();
}

void CoarseLevel::take_part(const ProblemPart& part) {
  CoarsePart mine = coarse_part(space_, colours_, part);
  linear_.take_part(mine.numbers);
  space_ = std::move(mine.space);
  colours_ = std::move(mine.colours);
  cells_ = std::move(mine.cells);
  nodes_ = std::move(mine.nodes);
  by_colour_ = std::move(mine.by_colour);
  contributions_ = std::move(mine.contributions);
}

void CoarseLevel::make_vectors() {
  const int d = problem_.dimension;
  const std::size_t floats = static_cast<std::size_t>(space_.count) * padded(d);
  entry_.resize(pattern_.column.size() * d * d + 1);
  inverse_factor_.resize(static_cast<std::size_t>(space_.count) * d * d + 1);
  entry_.back() = 0;
  inverse_factor_.back() = 0;
  for (UntouchedVector<float>* vector : {&r_, &x_, &residual_}) {
    vector->resize(floats);
    team_.for_ranges(floats, kFloatsPerTask, [&](std::size_t begin, std::size_t end) {
      std::fill_n(vector->data() + begin, end - begin, 0.0F);
    });
  }
  rows_ = {pattern_.begin.data(), pattern_.column.data(), entry_.data(), r_.data(), x_.data(), residual_.data()};
}

void CoarseLevel::exchange(UntouchedVector<float>& numbers, std::size_t width) const {
  if (part_ != nullptr) nodes_.exchange(numbers.data(), width, *part_->share.ranks);
}

void CoarseLevel::exchange_colour(std::size_t colour) {
  if (part_ == nullptr) return;
  by_colour_[colour].exchange(x_.data(), static_cast<std::size_t>(padded(problem_.dimension)), *part_->share.ranks);
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
  for (std::int64_t p = cells_.begin[at(node)]; p < cells_.begin[at(node) + 1]; ++p) {
    const Incidence& in = cells_.incidences[at(p)];
    K += stiffness<d>(tensor<d>(at(in.set), in.cell), space_.sets[at(in.set)], in.local, in.local);
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
  const auto begin = pattern_.column.begin() + pattern_.begin[at(node)],
             end = pattern_.column.begin() + pattern_.begin[at(node) + 1];
  static thread_local std::vector<BlockMatrix<d>> row;
  row.assign(end - begin, BlockMatrix<d>::Zero());
  for (std::int64_t p = cells_.begin[at(node)]; p < cells_.begin[at(node) + 1]; ++p) {
    const Incidence& in = cells_.incidences[at(p)];
    const CoarseSpace::Set& set = space_.sets[at(in.set)];
    const Tensor<d> M = tensor<d>(at(in.set), in.cell);
    const std::int32_t* nodes = set.nodes.data() + static_cast<std::size_t>(in.cell) * set.nodes_per_cell;
    for (int b = 0; b < set.nodes_per_cell; ++b)
      if (nodes[b] >= 0 && nodes[b] != node)
        row[std::lower_bound(begin, end, nodes[b]) - begin] += stiffness<d>(M, set, in.local, b);
  }
  const BlockMatrix<d> own = kLargestFixedPoint * inverse_factor<d>(node);
  std::int16_t* to = entry_.data() + pattern_.begin[at(node)] * d * d;
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

std::int64_t CoarseLevel::assembly_work() const {
  std::int64_t work = space_.count;
  for (const BatchSet& set : batches_) work += std::int64_t{kBatch} * set.count;
  return space_.count > 0 ? work : 0;
}

void CoarseLevel::assemble(const HessianKernels& hessian, WorkMeter* meter) {
  if (space_.count == 0 && part_ == nullptr) return;
  for (std::size_t b = 0; b < batches_.size(); ++b)
    team_.for_each(batches_[b].count, 4, [&](std::int32_t batch) {
      hessian.mean_tensors(batches_[b], batch, tensors_[b]);
      if (meter != nullptr) meter->add(kBatch);
    });
  if (part_ != nullptr) {
    std::vector<float*> arrays;
    for (std::vector<float>& of_set : tensors_) arrays.push_back(of_set.data());
    part_->share.cells.exchange<float>(arrays, at(tensor_size(problem_.dimension)), *part_->share.ranks);
  }
  make_matrix(meter);
}

void CoarseLevel::make_matrix(WorkMeter* meter) {
  if (space_.count == 0 && part_ == nullptr) return;
  const int d = problem_.dimension;
  team_.for_each(space_.count, kNodesPerTask / 4,
                 [&](std::int32_t node) { d == 2 ? factorise_diagonal<2>(node) : factorise_diagonal<3>(node); });
  exchange(inverse_factor_, at(d) * at(d));
  team_.for_each(space_.count, kNodesPerTask / 4, [&](std::int32_t node) {
    d == 2 ? assemble_row<2>(node) : assemble_row<3>(node);
    if (meter != nullptr) meter->add();
  });
  if (linear_.is_used()) linear_.assemble(tensors_);
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
    for (std::int32_t node = first; node < last; ++node)  // to the scale of K: L_i times it
      times_factor<d>(inverse_factor<d>(node), &residual_[node * kStride]);
  });
  exchange(residual_, kStride);
  linear_.solve(residual_.data());
  for_nodes(0, space_.count, [&](std::int32_t first, std::int32_t last) {
    for (std::int32_t node = first; node < last; ++node) {
      std::array<float, d> correction = linear_.value<d>(node);
      times_factor_transposed<d>(inverse_factor<d>(node), correction.data());  // to the scale of x: L_iᵀ times it
      for (int k = 0; k < d; ++k) x_[node * kStride + k] += correction[k];
    }
  });
  exchange(x_, kStride);
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
  if (space_.count == 0 && part_ == nullptr) return;
  for (std::size_t b = 0; b < batches_.size(); ++b)
    team_.for_each(batches_[b].count, 4, [&](std::int32_t batch) {
      kernels_->restrict_cells(batches_[b], batch, to_coarse_[b], shared.data());
    });
  const int d = problem_.dimension;
  if (part_ != nullptr) {
    std::vector<float*> arrays;
    for (BatchSet& set : batches_) arrays.push_back(set.contributions.data());
    contributions_.exchange<float>(arrays, at(d), *part_->share.ranks);
  }
  const auto contributions = contributions_of(batches_, [&](std::size_t b) { return space_.sets[b].nodes_per_cell; });
  for_nodes(0, space_.count, [&](std::int32_t first, std::int32_t last) {
    kernels_->add_up(contributions, cells_.begin.data(), cells_.incidences.data(), inverse_factor_.data(), r_.data(),
                     first, last);
  });
  // x is 0 at first, so the nodes of later colours do not count yet.
  for (std::size_t colour = 0; colour + 1 < colours_.size(); ++colour) {
    for_nodes(colours_[colour], colours_[colour + 1],
              [&](std::int32_t first, std::int32_t last) { kernels_->forward(rows_, first, last); });
    exchange_colour(colour);
  }
  if (linear_.is_used()) d == 2 ? correct_linear<2>() : correct_linear<3>();
  for (std::size_t colour = colours_.size() - 1; colour-- > 0;) {
    for_nodes(colours_[colour], colours_[colour + 1],
              [&](std::int32_t first, std::int32_t last) { kernels_->backward(rows_, first, last); });
    exchange_colour(colour);
  }
  d == 2 ? unscale<2>() : unscale<3>();
}

}  // namespace varimesh
