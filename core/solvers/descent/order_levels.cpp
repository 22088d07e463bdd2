#include "core/solvers/descent/order_levels.h"

#include "core/solvers/descent/order_tables.h"

namespace varimesh {
namespace {

constexpr std::size_t kNumbersPerTask = 4096;

}  // namespace

OrderLevels::OrderLevels(const Problem& problem, const OrderSpace& own, const Team& team)
    : problem_(problem), team_(team), reduction_(team) {
  for (int order = 1; order < own.order; ++order) lower_.push_back(lower_space(problem, order, team));
  for (const OrderSpace& space : lower_) {
    spaces_.push_back(&space);
    residuals_.emplace_back(static_cast<std::size_t>(space.count) * problem.dimension);
    solutions_.emplace_back(residuals_.back().size());
  }
  spaces_.push_back(&own);
}

void OrderLevels::take_diagonals(ModalForm& form, std::span<const double> stiffness) {
  contributions_ = form.room();
  inverse_diagonals_ = form.diagonals(spaces_, stiffness);
  for (std::vector<double>& diagonal : inverse_diagonals_)
    team_.for_ranges(diagonal.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t node = begin; node < end; ++node) diagonal[node] = diagonal[node] > 0 ? 1 / diagonal[node] : 0;
    });
}

double OrderLevels::apply(std::span<const double> r, std::span<double> z) {
  const std::size_t levels = spaces_.size();
  for (std::size_t level = levels - 1; level-- > 0;)
    restrict_to(level, level + 2 == levels ? r : residuals_[level + 1]);
  for (std::size_t level = 0; level < levels; ++level) {
    const bool last = level + 1 == levels;
    const std::span<const double> residual = last ? r : residuals_[level];
    const std::span<double> solution = last ? z : solutions_[level];
    const std::size_t d = problem_.dimension;
    if (level > 0) raise_from(level - 1, solution);
    const std::vector<double>& inverse = inverse_diagonals_[level];
    team_.for_ranges(inverse.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t node = begin; node < end; ++node)
        for (std::size_t k = 0; k < d; ++k)
          solution[node * d + k] = (level > 0 ? solution[node * d + k] : 0.0) + inverse[node] * residual[node * d + k];
    });
  }
  return reduction_.sum(r.size(), kNumbersPerTask, [&](std::size_t i) { return r[i] * z[i]; });
}

void OrderLevels::restrict_to(std::size_t level, std::span<const double> above) {
  const OrderSpace &low = *spaces_[level], &high = *spaces_[level + 1];
  const int d = problem_.dimension;
  for_cells_together(problem_, team_, [&](std::size_t set, std::int32_t first, std::int32_t count) {
    thread_local Eigen::MatrixXd values, restricted;
    gather(high.sets[set].owned, high.sets[set].nodes_per_cell, first, count, d, above, values);
    const CellSet& cells = problem_.sets[set];
    restricted.noalias() = detail::order_tables(cells.shape, cells.order).raise[level].transpose() * values;
    const int nodes = low.sets[set].nodes_per_cell;
    const std::size_t at = static_cast<std::size_t>(low.sets[set].first) + static_cast<std::size_t>(first) * nodes;
    for (std::int32_t i = 0; i < count; ++i)
      for (int n = 0; n < nodes; ++n)
        for (int k = 0; k < d; ++k)
          contributions_[(at + static_cast<std::size_t>(i) * nodes + n) * d + k] =
              restricted(n, static_cast<Eigen::Index>(i) * d + k);
  });
  add_up(problem_, low, d, contributions_, residuals_[level], team_);
}

/// Sets the values of the space above. All cells of a node give it the same value; the first one writes it.
void OrderLevels::raise_from(std::size_t level, std::span<double> above) {
  const OrderSpace &low = *spaces_[level], &high = *spaces_[level + 1];
  const int d = problem_.dimension;
  for_cells_together(problem_, team_, [&](std::size_t set, std::int32_t first, std::int32_t count) {
    thread_local Eigen::MatrixXd values, raised;
    gather(low.sets[set].numbers, low.sets[set].nodes_per_cell, first, count, d, solutions_[level], values);
    const CellSet& cells = problem_.sets[set];
    raised.noalias() = detail::order_tables(cells.shape, cells.order).raise[level] * values;
    const int nodes = high.sets[set].nodes_per_cell;
    const std::int32_t* owned = high.sets[set].owned.data() + static_cast<std::size_t>(first) * nodes;
    for (std::int32_t i = 0; i < count; ++i)
      for (int n = 0; n < nodes; ++n) {
        const std::int32_t number = owned[static_cast<std::size_t>(i) * nodes + n];
        for (int k = 0; number >= 0 && k < d; ++k)
          above[static_cast<std::size_t>(number) * d + k] = raised(n, static_cast<Eigen::Index>(i) * d + k);
      }
  });
}

}  // namespace varimesh
