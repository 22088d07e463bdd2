#include "core/solvers/descent/modal_form.h"

#include <Eigen/LU>
#include <cmath>

#include "core/quality/accuracy/parts_table.h"
#include "core/solvers/descent/order_tables.h"

namespace varimesh {
namespace {

constexpr std::size_t kCellsPerSum = 512;

/// Calls visit(pair, a, b) for a ≤ b < d, in the order of PartsTable::products.
template <class Visit>
void for_pairs(int d, const Visit& visit) {
  for (int a = 0, pair = 0; a < d; ++a)
    for (int b = a; b < d; ++b, ++pair) visit(static_cast<std::size_t>(pair), a, b);
}

}  // namespace

ModalForm::ModalForm(const Problem& problem, const OrderSpace& space, const Team& team)
    : problem_(problem),
      space_(space),
      team_(team),
      reduction_(team),
      shares_(problem.cells),
      squared_sizes_(problem.cells),
      metrics_(problem.cells),
      values_(problem.cells),
      contributions_(static_cast<std::size_t>(space.place_count) * problem.dimension) {
  take_frames();
}

void ModalForm::take_frames() {
  for_cells_together(problem_, team_,
                     [&](std::size_t set, std::int32_t first, std::int32_t count) { measure(set, first, count); });
  volume_ = reduction_.sum(shares_.size(), kCellsPerSum, [&](std::size_t cell) { return shares_[cell]; });
  for (std::size_t cell = 0; cell < shares_.size(); ++cell) {
    shares_[cell] /= volume_;
    squared_sizes_[cell] = std::pow(shares_[cell], 2.0 / problem_.dimension);
  }
}

void ModalForm::gather_positions(const CellSet& set, std::int32_t first, std::int32_t count,
                                 Eigen::MatrixXd& out) const {
  const int d = problem_.dimension, nodes = set.nodes_per_cell;
  out.resize(nodes, static_cast<Eigen::Index>(count) * d);
  for (std::int32_t cell = 0; cell < count; ++cell) {
    const std::int32_t* of_cell = set.nodes.data() + static_cast<std::size_t>(first + cell) * nodes;
    const auto x = [&](int i, int k) { return problem_.positions[static_cast<std::size_t>(of_cell[i]) * d + k]; };
    for (int k = 0; k < d; ++k)
      for (int i = 0; i < nodes; ++i) out(i, static_cast<Eigen::Index>(cell) * d + k) = x(i, k) - x(0, k);
  }
}

/// V_E into shares_, and the metrics.
void ModalForm::measure(std::size_t number, std::int32_t first, std::int32_t count) {
  const CellSet& set = problem_.sets[number];
  const detail::PartsTable& table =
      detail::parts_table(set.shape, set.order, reference::NodeSet::Optimised, team_.stop());
  const int d = problem_.dimension;
  Eigen::MatrixXd nodes;
  gather_positions(set, first, count, nodes);
  const Eigen::MatrixXd gradients = table.mean_gradient * nodes;
  for (std::int32_t i = 0; i < count; ++i) {
    const std::size_t cell = static_cast<std::size_t>(set.first) + first + i;
    const Eigen::MatrixXd transposed = gradients.middleCols(static_cast<Eigen::Index>(i) * d, d);
    const double determinant = transposed.determinant();
    shares_[cell] = reference::info(set.shape).measure * std::abs(determinant);
    metrics_[cell] = {};
    if (determinant == 0) continue;
    const Eigen::MatrixXd inverse = transposed.inverse(), metric = inverse.transpose() * inverse;
    for_pairs(d, [&](std::size_t pair, int a, int b) { metrics_[cell][pair] = metric(a, b); });
  }
}

std::array<double, 6> ModalForm::factors(std::size_t cell, std::size_t part) const {
  const int d = problem_.dimension;
  double weight = shares_[cell];
  for (int s = static_cast<int>(part) + 2; s <= space_.order; ++s) weight *= squared_sizes_[cell];
  std::array<double, 6> result{};
  for_pairs(d,
            [&](std::size_t pair, int a, int b) { result[pair] = (a == b ? 1 : 2) * weight * metrics_[cell][pair]; });
  return result;
}

double ModalForm::gradient(std::span<double> gradient) {
  const int d = problem_.dimension;
  for_cells_together(problem_, team_, [&](std::size_t number, std::int32_t first, std::int32_t count) {
    const CellSet& set = problem_.sets[number];
    const detail::PartsTable& table = detail::parts_table(set.shape, set.order, reference::NodeSet::Optimised);
    thread_local Eigen::MatrixXd nodes, modes, product, slopes, back;
    gather_positions(set, first, count, nodes);
    modes.noalias() = table.to_modes * nodes;
    slopes.setZero(modes.rows(), modes.cols());
    for (std::size_t part = 0; part < table.products.size(); ++part) {
      const Eigen::Index begin = table.first[part], rows = table.first[part + 1] - begin;
      for_pairs(d, [&](std::size_t pair, int, int) {
        product.noalias() = table.products[part][pair] * modes.middleRows(begin, rows);
        for (std::int32_t i = 0; i < count; ++i) {
          const double factor = factors(static_cast<std::size_t>(set.first) + first + i, part)[pair];
          const Eigen::Index column = static_cast<Eigen::Index>(i) * d;
          slopes.block(begin, column, rows, d) += factor * product.middleCols(column, d);
        }
      });
    }
    for (std::int32_t i = 0; i < count; ++i) {
      const Eigen::Index column = static_cast<Eigen::Index>(i) * d;
      values_[static_cast<std::size_t>(set.first) + first + i] =
          modes.middleCols(column, d).cwiseProduct(slopes.middleCols(column, d)).sum();
    }
    back.noalias() = 2 * table.to_modes.transpose() * slopes;
    const std::size_t at =
        static_cast<std::size_t>(space_.sets[number].first) + static_cast<std::size_t>(first) * set.nodes_per_cell;
    for (std::int32_t i = 0; i < count; ++i)
      for (int n = 0; n < set.nodes_per_cell; ++n)
        for (int k = 0; k < d; ++k)
          contributions_[(at + static_cast<std::size_t>(i) * set.nodes_per_cell + n) * d + k] =
              back(n, static_cast<Eigen::Index>(i) * d + k);
  });
  add_up(space_, d, contributions_, gradient, team_);
  return reduction_.sum(values_.size(), kCellsPerSum, [&](std::size_t cell) { return values_[cell]; });
}

std::vector<std::vector<double>> ModalForm::diagonals(std::span<const OrderSpace* const> spaces,
                                                      std::span<const double> stiffness) {
  const int d = problem_.dimension;
  std::vector<std::vector<double>> result;
  for (std::size_t level = 0; level < spaces.size(); ++level) {
    const OrderSpace& space = *spaces[level];
    std::vector<double>& diagonal = result.emplace_back(space.count);
    std::vector<double> of_places(static_cast<std::size_t>(space.place_count));
    for_cells_together(problem_, team_, [&](std::size_t number, std::int32_t first, std::int32_t count) {
      const CellSet& set = problem_.sets[number];
      const detail::OrderTables& tables = detail::order_tables(set.shape, set.order);
      const detail::OrderTables::Squares& squares = tables.squares[level];
      const int nodes = space.sets[number].nodes_per_cell;
      for (std::int32_t i = 0; i < count; ++i) {
        const std::size_t cell = static_cast<std::size_t>(set.first) + first + i;
        Eigen::VectorXd sum = Eigen::VectorXd::Zero(nodes);
        for (std::size_t part = 0; part < squares.of_parts.size(); ++part) {
          const std::array<double, 6> factor = factors(cell, part);
          for_pairs(d, [&](std::size_t pair, int, int) { sum += 2 * factor[pair] * squares.of_parts[part][pair]; });
        }
        for_pairs(d, [&](std::size_t pair, int a, int b) {
          sum += (a == b ? 1 : 2) * shares_[cell] * stiffness[cell] * metrics_[cell][pair] * squares.of_gradient[pair];
        });
        Eigen::Map<Eigen::VectorXd>(&of_places[static_cast<std::size_t>(space.sets[number].first) +
                                               static_cast<std::size_t>(first + i) * nodes],
                                    nodes) = sum;
      }
    });
    add_up(space, 1, of_places, diagonal, team_);
  }
  return result;
}

}  // namespace varimesh
