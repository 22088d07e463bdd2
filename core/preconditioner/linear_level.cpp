#include "core/preconditioner/linear_level.h"

#include <algorithm>
#include <cmath>

#include "core/base/aligned.h"
#include "core/base/index.h"
#include "core/kernels/hessian/batches.h"
#include "core/preconditioner/coarse_part.h"
#include "core/reference/basis.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNodesPerTask = 128;
constexpr std::size_t kEntriesPerTask = 8192;
constexpr double kLeastDiagonal = 1e-14;  // relative to the largest entry

/// Values of functions of order 1 at the nodes of the space above; only free nodes on either side.
SparseRows values_above(const Problem& problem, const CoarseSpace& above, const NodeCells& cells,
                        const CoarseSpace& linear, const Team& team) {
  std::vector<Eigen::MatrixXd> values;  // by set: of the vertices' functions at the nodes above
  for (const CellSet& set : problem.sets)
    values.push_back(reference::basis_values(
        set.shape, 1, reference::NodeSet::Equispaced, problem.dimension,
        reference::nodes(set.shape, above.order, reference::NodeSet::Equispaced, problem.dimension)));
  // All cells of a node give it the same row; the first is asked.
  const auto for_entries = [&](std::int32_t node, const auto& body) {
    const Incidence& in = cells.incidences[at(cells.begin[at(node)])];
    const CoarseSpace::Set& coarse = linear.sets[at(in.set)];
    for (int v = 0; v < coarse.nodes_per_cell; ++v) {
      const std::int32_t vertex = coarse.nodes[at(in.cell) * at(coarse.nodes_per_cell) + at(v)];
      const double value = values[at(in.set)](in.local, v);
      if (vertex >= 0 && std::abs(value) > 1e-12) body(vertex, static_cast<float>(value));
    }
  };
  SparseRows out;
  out.begin.assign(at(above.count) + 1, 0);
  team.for_each(above.count, kNodesPerTask,
                [&](std::int32_t node) { for_entries(node, [&](std::int32_t, float) { ++out.begin[at(node) + 1]; }); });
  for (std::size_t node = 0; node < at(above.count); ++node) out.begin[node + 1] += out.begin[node];
  out.column.resize(at(out.begin.back()));
  out.factor.resize(at(out.begin.back()));
  team.for_each(above.count, kNodesPerTask, [&](std::int32_t node) {
    std::size_t to = at(out.begin[at(node)]);
    for_entries(node, [&](std::int32_t vertex, float value) {
      out.column[to] = vertex;
      out.factor[to++] = value;
    });
  });
  return out;
}

}  // namespace

LinearLevel::LinearLevel(const Problem& problem, const CoarseSpace& above, const NodeCells& cells_above,
                         const Team& team, const ProblemPart* part)
    : problem_(problem),
      team_(team),
      part_(part),
      space_(coarse_space(problem, 1, team)),
      cells_(node_cells(space_, team)),
      to_above_(values_above(problem, above, cells_above, space_, team)),
      from_above_(transposed(to_above_, space_.count)),
      pattern_(node_pattern(space_, cells_, true, team)),
      entry_(pattern_.column.size()),
      multigrid_(team),
      reduction_(team),
      right_(at(space_.count) * at(problem.dimension)),
      solution_(right_.size()) {}

void LinearLevel::take_part(const std::vector<std::int32_t>& numbers_above) {
  to_above_ = rows_of(to_above_, numbers_above);
  from_above_ = transposed(to_above_, space_.count);
  const std::vector<std::int32_t> ranks = ranks_of_coarse_nodes(space_, *part_);
  for (std::int32_t rank = 0; rank < part_->partition.ranks; ++rank)
    for (std::int32_t vertex = 0; vertex < space_.count; ++vertex)
      if (ranks[at(vertex)] == rank) {
        by_rank_.push_back(vertex);
        if (rank == part_->share.ranks->rank()) own_.push_back(vertex);
      }
  for (std::size_t s = 0; s < part_->cells.size(); ++s) {
    std::vector<std::int32_t>& places = places_.emplace_back(at(problem_.sets[s].count), -1);
    for (std::size_t place = 0; place < part_->cells[s].size(); ++place)
      if (part_->cells[s][place] >= 0) places[at(part_->cells[s][place])] = static_cast<std::int32_t>(place);
  }
}

template <class Body>
void LinearLevel::for_own(const Body& body) const {
  if (part_ == nullptr) return team_.for_each(space_.count, kNodesPerTask, body);
  team_.for_each(static_cast<std::int32_t>(own_.size()), kNodesPerTask, [&](std::int32_t i) { body(own_[at(i)]); });
}

template <class Begin>
void LinearLevel::gather(std::vector<double>& numbers, const Begin& begin) const {
  if (part_ == nullptr) return;
  std::vector<double> mine;
  for (const std::int32_t vertex : own_)
    mine.insert(mine.end(), numbers.begin() + begin(vertex), numbers.begin() + begin(vertex + 1));
  const std::vector<double> all = part_->share.ranks->gather_everywhere(mine);
  auto from = all.begin();
  for (const std::int32_t vertex : by_rank_) {
    const std::ptrdiff_t count = begin(vertex + 1) - begin(vertex);
    std::copy_n(from, count, numbers.begin() + begin(vertex));
    from += count;
  }
}

template <int d>
double LinearLevel::stiffness(std::size_t set, const float* tensor, int i, int j) const {
  // Σ M(m m, k l) means(k l), also over the directions m
  const float* means =
      space_.sets[set].stiffness.data() + (at(i) * at(space_.sets[set].nodes_per_cell) + at(j)) * d * d;
  double sum = 0;
  for (int m = 0; m < d; ++m)
    for (int k = 0; k < d; ++k)
      for (int l = 0; l < d; ++l) {
        const int mk = m * d + std::max(k, l), ml = m * d + std::min(k, l);
        sum += static_cast<double>(tensor[lower_index(mk, ml)]) * means[k * d + l];
      }
  return sum / d * (i == j ? 1 + 1e-6 : 1.0);
}

template <int d>
void LinearLevel::assemble_row(std::int32_t vertex, const std::vector<std::vector<float>>& tensors) {
  const auto begin = pattern_.column.begin() + pattern_.begin[at(vertex)],
             end = pattern_.column.begin() + pattern_.begin[at(vertex) + 1];
  double* row = entry_.data() + pattern_.begin[at(vertex)];
  std::fill_n(row, end - begin, 0.0);
  for (std::int64_t p = cells_.begin[at(vertex)]; p < cells_.begin[at(vertex) + 1]; ++p) {
    const Incidence& in = cells_.incidences[at(p)];
    const CoarseSpace::Set& set = space_.sets[at(in.set)];
    const std::int32_t place = part_ == nullptr ? in.cell : places_[at(in.set)][at(in.cell)];
    const float* tensor = tensors[at(in.set)].data() + at(place) * tensor_size(d);
    for (int j = 0; j < set.nodes_per_cell; ++j) {
      const std::int32_t other = set.nodes[at(in.cell) * at(set.nodes_per_cell) + at(j)];
      if (other < 0) continue;
      // From the lower triangle, so that the matrix is symmetric to the last bit.
      row[std::lower_bound(begin, end, other) - begin] += other <= vertex
                                                              ? stiffness<d>(at(in.set), tensor, in.local, j)
                                                              : stiffness<d>(at(in.set), tensor, j, in.local);
    }
  }
}

void LinearLevel::raise_diagonal() {
  // The p-norm may leave the cells of a vertex almost no weight; multigrid needs a diagonal all the same.
  const double raise =
      kLeastDiagonal * reduction_.largest(entry_.size(), kEntriesPerTask, [&](std::size_t i) { return entry_[i]; });
  team_.for_each(space_.count, kNodesPerTask, [&](std::int32_t vertex) {
    const auto begin = pattern_.column.begin() + pattern_.begin[at(vertex)],
               end = pattern_.column.begin() + pattern_.begin[at(vertex) + 1];
    entry_[at(std::lower_bound(begin, end, vertex) - pattern_.column.begin())] += raise;
  });
}

void LinearLevel::assemble(const std::vector<std::vector<float>>& tensors) {
  const int d = problem_.dimension;
  for_own([&](std::int32_t vertex) { d == 2 ? assemble_row<2>(vertex, tensors) : assemble_row<3>(vertex, tensors); });
  gather(entry_, [&](std::int32_t vertex) { return pattern_.begin[at(vertex)]; });
  raise_diagonal();
  multigrid_.set_up({space_.count, pattern_.begin.data(), pattern_.column.data(), entry_.data()});
}

template <int d>
void LinearLevel::restrict_residual(const float* residual) {
  constexpr std::size_t kStride = padded(d);
  for_own([&](std::int32_t vertex) {
    std::array<double, 3> sum{};
    for (std::int64_t i = from_above_.begin[vertex]; i < from_above_.begin[vertex + 1]; ++i)
      for (int k = 0; k < d; ++k) sum[k] += from_above_.factor[i] * residual[from_above_.column[i] * kStride + k];
    for (int k = 0; k < d; ++k) right_[at(vertex) * d + at(k)] = sum[at(k)];
  });
}

void LinearLevel::solve(const float* residual) {
  const int d = problem_.dimension;
  d == 2 ? restrict_residual<2>(residual) : restrict_residual<3>(residual);
  gather(right_, [&](std::int32_t vertex) { return std::ptrdiff_t{vertex} * d; });
  multigrid_.apply(right_, solution_, d);
}

}  // namespace varimesh
