#include "core/solvers/descent/form/order_levels.h"

#include "core/base/index.h"
#include "core/solvers/descent/form/order_tables.h"
#include "core/terms/cell_energy.h"

namespace varimesh {
namespace {

constexpr std::size_t kNumbersPerTask = 4096;

}  // namespace

OrderLevels::OrderLevels(const Problem& problem, const OrderSpace& own, const Team& team, const ProblemPart* part)
    : problem_(problem), team_(team), reduction_(whole_reduction(team, part)) {
  for (int order = 1; order < own.order; ++order) lower_.push_back(lower_space(problem, order, team, part));
  for (const OrderSpace& space : lower_) {
    spaces_.push_back(&space);
    residuals_.emplace_back(static_cast<std::size_t>(space.count) * problem.dimension);
    solutions_.emplace_back(residuals_.back().size());
  }
  spaces_.push_back(&own);
  for (const CellSet& set : problem.sets) tables_.push_back(&detail::order_tables(set.shape, set.order));
}

void OrderLevels::take_diagonals(ModalForm& form, std::span<const double> stiffness) {
  contributions_ = form.room();
  inverse_diagonals_ = form.diagonals(spaces_, stiffness);
  for (std::vector<double>& diagonal : inverse_diagonals_)
    team_.for_ranges(diagonal.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t node = begin; node < end; ++node) diagonal[node] = diagonal[node] > 0 ? 1 / diagonal[node] : 0;
    });
}

double OrderLevels::apply(std::span<double> r, std::span<double> z) {
  const std::size_t levels = spaces_.size();
  for (std::size_t level = levels - 1; level-- > 0;)
    restrict_to(level, level + 2 == levels ? r : residuals_[level + 1]);
  for (std::size_t level = 0; level < levels; ++level) {
    const bool last = level + 1 == levels;
    const std::span<double> residual = last ? r : residuals_[level];
    const std::span<double> solution = last ? z : solutions_[level];
    const std::size_t d = problem_.dimension;
    if (level > 0) raise_from(level - 1, solution);
    const std::vector<double>& inverse = inverse_diagonals_[level];
    team_.for_ranges(at(spaces_[level]->own_count), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t node = begin; node < end; ++node)
        for (std::size_t k = 0; k < d; ++k)
          solution[node * d + k] = (level > 0 ? solution[node * d + k] : 0.0) + inverse[node] * residual[node * d + k];
    });
  }
  const std::size_t numbers = at(spaces_.back()->own_count) * at(problem_.dimension);
  return reduction_.sum(numbers, kNumbersPerTask, [&](std::size_t i) { return r[i] * z[i]; });
}

void OrderLevels::restrict_to(std::size_t level, std::span<double> above) {
  change_kind_of_numbers();
  const OrderSpace &low = *spaces_[level], &high = *spaces_[level + 1];
  high.share.exchange(high.share.to_first, above, problem_.dimension);
  const std::size_t d = at(problem_.dimension);
  for_cells_together(problem_, team_, [&](std::size_t set, std::int32_t first, std::int32_t count) {
    const OrderSpace::Set &to = low.sets[set], &from = high.sets[set];
    const double* products = multiply(tables_[set]->raise[level].back, from, Occurrence::First, first, count, above);
    const std::size_t nodes = at(to.nodes_per_cell), place = at(to.first) + at(first) * nodes;
    for (std::size_t lane = 0; lane < at(count); ++lane)
      for (std::size_t i = 0; i < nodes * d; ++i)
        contributions_[(place + lane * nodes) * d + i] = products[i * detail::kCellLanes + lane];
  });
  add_up(problem_, low, problem_.dimension, contributions_, residuals_[level], team_);
}

/// Sets the values of the space above. All cells of a node give it the same value; the first one writes it.
void OrderLevels::raise_from(std::size_t level, std::span<double> above) {
  const OrderSpace &low = *spaces_[level], &high = *spaces_[level + 1];
  const std::size_t d = at(problem_.dimension);
  low.share.exchange(low.share.values, solutions_[level], problem_.dimension);
  for_cells_together(problem_, team_, [&](std::size_t set, std::int32_t first, std::int32_t count) {
    const OrderSpace::Set &to = high.sets[set], &from = low.sets[set];
    const double* products =
        multiply(tables_[set]->raise[level].there, from, Occurrence::Every, first, count, solutions_[level]);
    const std::size_t nodes = at(to.nodes_per_cell);
    for (std::size_t lane = 0; lane < at(count); ++lane)
      for (std::size_t n = 0; n < nodes; ++n) {
        const std::size_t place = (at(first) + lane) * nodes + n;
        for (std::size_t k = 0; to.is_first[place] != 0 && k < d; ++k)
          above[at(to.numbers[place]) * d + k] = products[(n * d + k) * detail::kCellLanes + lane];
      }
  });
  high.share.exchange(high.share.from_first, above, problem_.dimension);
}

static_assert(at(kCellsTogether) == detail::kCellLanes);

/// A matrix times the values of a vector in cells `first` … `first` + `count` − 1 of a set: [row][direction][lane].
/// `taken`: of gather(). The thread's next call overwrites the result.
const double* OrderLevels::multiply(const detail::LaneMatrix& matrix, const OrderSpace::Set& set, Occurrence taken,
                                    std::int32_t first, std::int32_t count, std::span<const double> vector) const {
  thread_local std::vector<double> values, products, room;
  const std::size_t d = at(problem_.dimension);
  values.resize(matrix.columns * d * detail::kCellLanes);
  products.resize(matrix.rows * d * detail::kCellLanes);
  gather(set, taken, first, count, problem_.dimension, vector, values);
  detail::multiply_lanes(matrix, d, values.data(), products.data(), room);
  return products.data();
}

}  // namespace varimesh
