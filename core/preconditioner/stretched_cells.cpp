#include "core/preconditioner/stretched_cells.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/base/exact_sum.h"
#include "core/base/index.h"
#include "core/base/shared_work.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"

namespace varimesh {
namespace {

constexpr std::int32_t kCellsPerTask = 256;
constexpr std::size_t kLeastShared = 3;  // nodes that two cells of a group share: those of an edge or a face
constexpr double kRaise = 1e-6;          // of the diagonal, for entries in single precision
constexpr double kNothing = 1e-34;       // the inverse of a smaller diagonal may not fit a float

template <int d>
using SmallMatrix = Eigen::Matrix<double, d, d>;

/// Means of ∂_k φ_a ∂_l φ_b over the reference cell, (k, l) innermost.
std::vector<float> means_of(const CellSet& set) {
  const int d = set.dimension, nodes = set.nodes_per_cell;
  const reference::Quadrature rule = reference::quadrature(set.shape, set.order, 2 * set.order);
  const auto gradients =
      reference::basis_gradients(set.shape, set.order, reference::NodeSet::Optimised, d, rule.points);
  const Eigen::VectorXd weights = rule.weights / rule.weights.sum();
  std::vector<float> means(at(nodes) * at(nodes) * at(d) * at(d));
  for (int k = 0; k < d; ++k)
    for (int l = 0; l < d; ++l) {
      const Eigen::MatrixXd mean = gradients[at(k)].transpose() * weights.asDiagonal() * gradients[at(l)];
      for (int a = 0; a < nodes; ++a)
        for (int b = 0; b < nodes; ++b)
          means[((at(a) * at(nodes) + at(b)) * at(d) + at(k)) * at(d) + at(l)] = static_cast<float>(mean(a, b));
    }
  return means;
}

/// The products of the edges of the regular cell along the reference axes: two axes in a triangle are 60° apart.
template <int d>
SmallMatrix<d> regular_metric(Shape shape) {
  SmallMatrix<d> metric = SmallMatrix<d>::Identity();
  if (shape == Shape::Triangle || shape == Shape::Tetrahedron) metric.array() += 0.5 * (1 - metric.array());
  if (d == 3 && shape == Shape::Prism) metric(0, 1) = metric(1, 0) = 0.5;
  return metric;
}

/// The square root of the ratio between the largest and the smallest eigenvalue of the tensor's trace over the
/// directions of displacement, in coordinates in which the reference cell is regular. 0 for a tensor of zeros.
template <int d>
double stretching_of(Shape shape, const float* tensor) {
  SmallMatrix<d> trace = SmallMatrix<d>::Zero();
  for (int k = 0; k < d; ++k)
    for (int l = 0; l <= k; ++l) {
      for (int i = 0; i < d; ++i) trace(k, l) += tensor[lower_index(i * d + k, i * d + l)];
      trace(l, k) = trace(k, l);
    }
  const SmallMatrix<d> factor = regular_metric<d>(shape).llt().matrixL();
  const SmallMatrix<d> regular = factor.transpose() * trace * factor;
  const Eigen::Matrix<double, d, 1> stiffness =
      Eigen::SelfAdjointEigenSolver<SmallMatrix<d>>(regular, Eigen::EigenvaluesOnly).eigenvalues();
  return stiffness[0] > kNothing ? std::sqrt(stiffness[d - 1] / stiffness[0]) : 0;
}

/// M of a cell: a row for each (i j), a column for each (k l).
template <int d>
Eigen::Matrix<float, d * d, d * d> full_tensor(const float* from) {
  Eigen::Matrix<float, d * d, d * d> M;
  for (int ik = 0; ik < d * d; ++ik)
    for (int jl = 0; jl <= ik; ++jl) {
      const int i = ik / d, k = ik % d, j = jl / d, l = jl % d;
      M(i * d + j, k * d + l) = M(j * d + i, l * d + k) = *from++;
    }
  return M;
}

std::size_t triangle(std::size_t rows) { return rows * (rows + 1) / 2; }

}  // namespace

StretchedCells::StretchedCells(const Problem& problem, const std::vector<BatchSet>& batches, std::int32_t most_cells,
                               const Team& team, const ProblemPart* part)
    : problem_(problem), batches_(batches), most_cells_(most_cells), team_(team), part_(part) {
  if (part != nullptr) free_ = places_in_free(problem);
  const auto is_small = [](const CellSet& set) { return set.nodes_per_cell <= kMostCellNodes; };
  if (!std::ranges::all_of(problem.sets, is_small)) return;
  for (const CellSet& set : problem.sets) means_.push_back(means_of(set));
}

bool StretchedCells::is_stretched(Cell cell, const std::vector<std::vector<float>>& tensors) const {
  const int d = problem_.dimension;
  const Shape shape = problem_.sets[at(cell.set)].shape;
  const float* tensor = tensors[at(cell.set)].data() + at(cell.cell) * at(tensor_size(d));
  return static_cast<float>(d == 2 ? stretching_of<2>(shape, tensor) : stretching_of<3>(shape, tensor)) >=
         kLeastStretching;
}

std::vector<StretchedCells::Cell> StretchedCells::find(const std::vector<std::vector<float>>& tensors) const {
  if (means_.empty()) return {};
  std::vector<char> is_one(at(problem_.cells));
  std::vector<Cell> found;
  for (std::int32_t set = 0; set < static_cast<std::int32_t>(problem_.sets.size()); ++set) {
    const CellSet& cells = problem_.sets[at(set)];
    team_.for_each(cells.count, kCellsPerTask, [&](std::int32_t cell) {
      is_one[at(cells.first + cell)] = is_stretched({set, cell}, tensors) ? 1 : 0;
    });
    for (std::int32_t cell = 0; cell < cells.count; ++cell)
      if (is_one[at(cells.first + cell)] != 0) found.push_back({set, cell});
  }
  if (static_cast<std::int32_t>(found.size()) > most_cells_) found.clear();
  return found;
}

std::int32_t StretchedCells::rank(Cell cell, int node) const {
  if (part_ == nullptr) {
    const BatchSet& set = batches_[at(cell.set)];
    return set.ranks[set.contribution_index(cell.cell, node, 1)];
  }
  const CellSet& cells = problem_.sets[at(cell.set)];
  const std::int32_t free = free_[at(cells.nodes[at(cell.cell) * at(cells.nodes_per_cell) + at(node)])];
  return free >= 0 ? free : static_cast<std::int32_t>(problem_.free.size());
}

std::vector<std::int32_t> StretchedCells::ranks_of(Cell cell) const {
  std::vector<std::int32_t> ranks;
  for (int node = 0; node < problem_.sets[at(cell.set)].nodes_per_cell; ++node)
    if (at(rank(cell, node)) < problem_.free.size()) ranks.push_back(rank(cell, node));
  std::ranges::sort(ranks);
  return ranks;
}

void StretchedCells::join(const std::vector<Cell>& cells) {
  constexpr std::int32_t kNone = -1;
  std::vector<std::int32_t> index(at(problem_.cells), kNone);  // of the cells, as long as they are in no group
  for (std::size_t i = 0; i < cells.size(); ++i)
    index[at(problem_.sets[at(cells[i].set)].first + cells[i].cell)] = static_cast<std::int32_t>(i);
  const auto index_of = [&](Cell cell) -> std::int32_t& {
    return index[at(problem_.sets[at(cell.set)].first + cell.cell)];
  };
  groups_.clear();
  for (const Cell first : cells) {
    if (index_of(first) == kNone) continue;
    index_of(first) = kNone;
    Group group;
    group.ranks = ranks_of(first);
    std::vector<Cell> members{first};
    for (std::size_t m = 0; m < members.size(); ++m) {
      std::vector<std::int32_t> neighbours;  // once for each shared node
      for (const std::int32_t node : ranks_of(members[m]))
        for (std::int32_t i = problem_.offsets[at(node)]; i < problem_.offsets[at(node) + 1]; ++i)
          if (const std::int32_t other = index_of({problem_.incidences[at(i)].set, problem_.incidences[at(i)].cell});
              other != kNone)
            neighbours.push_back(other);
      std::ranges::sort(neighbours);
      for (std::size_t i = 0; i + kLeastShared <= neighbours.size(); ++i) {
        if (neighbours[i] != neighbours[i + kLeastShared - 1]) continue;
        const Cell cell = cells[at(neighbours[i])];
        if (index_of(cell) == kNone) continue;
        std::vector<std::int32_t> joined;
        std::ranges::set_union(group.ranks, ranks_of(cell), std::back_inserter(joined));
        if (joined.size() > kMostNodes) continue;
        group.ranks = std::move(joined);
        index_of(cell) = kNone;
        members.push_back(cell);
      }
    }
    if (!group.ranks.empty()) groups_.push_back(std::move(group));
  }
}

void StretchedCells::assemble(const std::vector<std::vector<float>>& tensors) {
  if (part_ == nullptr) return assemble_whole(tensors);
  const std::vector<std::vector<float>> all = gather_if_stretched(tensors);
  if (all.empty())
    groups_.clear();
  else
    assemble_whole(all);
}

std::vector<std::vector<float>> StretchedCells::gather_if_stretched(
    const std::vector<std::vector<float>>& tensors) const {
  const auto size = at(tensor_size(problem_.dimension));
  std::int64_t count = 0;
  for (std::size_t s = 0; s < problem_.sets.size() && !means_.empty(); ++s)
    count += count_where(team_, at(part_->problem.sets[s].count), kCellsPerTask, [&](std::size_t cell) {
      return is_stretched({static_cast<std::int32_t>(s), static_cast<std::int32_t>(cell)}, tensors);
    });
  count = part_->share.ranks->sum(count);
  if (count == 0 || count > most_cells_) return {};
  std::vector<std::vector<float>> all;
  for (std::size_t s = 0; s < problem_.sets.size(); ++s) all.push_back(gather_set(*part_, s, tensors[s], size));
  return all;
}

void StretchedCells::assemble_whole(const std::vector<std::vector<float>>& tensors) {
  join(find(tensors));
  place_groups();
  std::vector<int> count(problem_.free.size(), 0);
  for (const Group& group : groups_)
    for (const std::int32_t node : group.ranks) ++count[at(node)];
  for (Group& group : groups_)
    for (const std::int32_t node : group.ranks)
      group.weight.push_back(1 / std::sqrt(static_cast<float>(count[at(node)])));
  team_.for_each(static_cast<std::int32_t>(groups_.size()), 1, [&](std::int32_t g) {
    problem_.dimension == 2 ? factorise<2>(groups_[at(g)], tensors) : factorise<3>(groups_[at(g)], tensors);
  });
}

template <int d>
void StretchedCells::factorise(Group& group, const std::vector<std::vector<float>>& tensors) const {
  const auto rows = static_cast<Eigen::Index>(group.ranks.size()) * d;
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(rows, rows);  // only its lower triangle
  std::vector<Cell> cells;
  for (const std::int32_t node : group.ranks)
    for (std::int32_t i = problem_.offsets[at(node)]; i < problem_.offsets[at(node) + 1]; ++i)
      cells.push_back({problem_.incidences[at(i)].set, problem_.incidences[at(i)].cell});
  std::ranges::sort(cells, [](Cell a, Cell b) { return std::pair(a.set, a.cell) < std::pair(b.set, b.cell); });
  const auto same = [](Cell a, Cell b) { return a.set == b.set && a.cell == b.cell; };
  cells.erase(std::unique(cells.begin(), cells.end(), same), cells.end());
  std::vector<std::pair<int, Eigen::Index>> inside;  // nodes of a cell, and where their rows begin
  for (const Cell cell : cells) {
    const int nodes = problem_.sets[at(cell.set)].nodes_per_cell;
    inside.clear();
    for (int a = 0; a < nodes; ++a) {
      const auto found = std::ranges::lower_bound(group.ranks, rank(cell, a));
      if (found != group.ranks.end() && *found == rank(cell, a))
        inside.emplace_back(a, (found - group.ranks.begin()) * d);
    }
    const auto M = full_tensor<d>(tensors[at(cell.set)].data() + at(cell.cell) * at(tensor_size(d)));
    const float* means = means_[at(cell.set)].data();
    for (const auto& [a, row] : inside)
      for (const auto& [b, column] : inside) {
        if (column > row) continue;
        const Eigen::Matrix<float, d * d, 1> block =
            M * Eigen::Map<const Eigen::Matrix<float, d * d, 1>>(means + (at(a) * at(nodes) + at(b)) * d * d);
        for (int i = 0; i < d; ++i)
          for (int j = 0; j < d; ++j) K(row + i, column + j) += block[i * d + j];
      }
  }
  group.inverse_factor.clear();
  if (!(K.diagonal().minCoeff() >= kNothing)) return;
  K.diagonal() *= 1 + kRaise;
  const Eigen::LLT<Eigen::MatrixXd> factor(K);
  if (factor.info() != Eigen::Success) return;
  const Eigen::MatrixXd inverse = factor.matrixL().solve(Eigen::MatrixXd::Identity(rows, rows));
  group.product.resize(at(rows));
  group.inverse_factor.reserve(triangle(at(rows)));
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) group.inverse_factor.push_back(static_cast<float>(inverse(i, j)));
}

template <int d>
void StretchedCells::apply(Group& group, std::span<const float> r) const {
  static thread_local std::vector<float> weighted;
  weighted.clear();
  for (std::size_t n = 0; n < group.ranks.size(); ++n)
    for (int k = 0; k < d; ++k) weighted.push_back(group.weight[n] * r[at(group.from[n]) * d + at(k)]);
  const auto rows = static_cast<Eigen::Index>(weighted.size());
  const Eigen::Map<const Eigen::VectorXf> from(weighted.data(), rows);
  Eigen::Map<Eigen::VectorXf> to(group.product.data(), rows);
  to.setZero();
  group.along = 0;
  const float* row = group.inverse_factor.data();
  for (Eigen::Index i = 0; i < rows; row += ++i) {
    const Eigen::Map<const Eigen::VectorXf> of_row(row, i + 1);
    const float value = of_row.dot(from.head(i + 1));
    to.head(i + 1) += value * of_row;
    group.along += static_cast<double>(value) * value;
  }
  for (std::size_t n = 0; n < group.ranks.size(); ++n)
    to.segment<d>(static_cast<Eigen::Index>(n) * d) *= group.weight[n];
}

void StretchedCells::place_groups() {
  own_at_groups_.clear();
  if (part_ == nullptr) {
    for (Group& group : groups_) group.from = group.to = group.ranks;
    return;
  }
  constexpr std::int32_t kNone = -1;
  std::vector<std::int32_t> from(problem_.free.size(), kNone), to(problem_.free.size(), kNone);
  for (const Group& group : groups_)
    for (const std::int32_t node : group.ranks) from[at(node)] = 0;
  std::vector<std::int32_t> nodes;
  for (std::int32_t f = 0; f < part_->share.own_nodes; ++f) {
    const std::int32_t node = part_->share.numbers[at(f)];
    if (from[at(node)] == kNone) continue;
    to[at(node)] = f;
    own_at_groups_.push_back(f);
    nodes.push_back(node);
  }
  nodes = part_->share.ranks->gather_everywhere(nodes);
  for (std::size_t i = 0; i < nodes.size(); ++i) from[at(nodes[i])] = static_cast<std::int32_t>(i);
  for (Group& group : groups_)
    for (const std::int32_t node : group.ranks) {
      group.from.push_back(from[at(node)]);
      group.to.push_back(to[at(node)]);
    }
}

std::vector<float> StretchedCells::gather_at_groups(std::span<const float> r) const {
  const std::size_t d = at(problem_.dimension);
  std::vector<float> mine;
  for (const std::int32_t f : own_at_groups_)
    for (std::size_t k = 0; k < d; ++k) mine.push_back(r[at(f) * d + k]);
  return part_->share.ranks->gather_everywhere(mine);
}

double StretchedCells::add(std::span<const float> r, std::span<float> z) {
  if (groups_.empty()) return 0;
  const std::size_t d = at(problem_.dimension);
  std::vector<float> gathered;
  if (part_ != nullptr) {
    gathered = gather_at_groups(r);
    r = gathered;
  }
  team_.for_each(static_cast<std::int32_t>(groups_.size()), 1, [&](std::int32_t g) {
    if (groups_[at(g)].inverse_factor.empty()) return;
    d == 2 ? apply<2>(groups_[at(g)], r) : apply<3>(groups_[at(g)], r);
  });
  ExactSum along;
  for (const Group& group : groups_) {
    if (group.inverse_factor.empty()) continue;
    along.add(group.along);
    for (std::size_t n = 0; n < group.to.size(); ++n)
      for (std::size_t k = 0; k < d && group.to[n] >= 0; ++k) z[at(group.to[n]) * d + k] += group.product[n * d + k];
  }
  return along.value();
}

std::vector<std::vector<std::int32_t>> StretchedCells::groups() const {
  std::vector<std::vector<std::int32_t>> ranks;
  for (const Group& group : groups_) ranks.push_back(group.ranks);
  return ranks;
}

}  // namespace varimesh
