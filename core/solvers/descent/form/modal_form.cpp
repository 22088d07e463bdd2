#include "core/solvers/descent/form/modal_form.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/base/io/large_arrays.h"
#include "core/quality/accuracy/parts_table.h"
#include "core/solvers/descent/form/order_tables.h"
#include "core/terms/cell_energy.h"

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

ModalForm::ModalForm(const Problem& problem, const OrderSpace& space, double wave, const Team& team,
                     std::span<double> room, const ProblemPart* part)
    : problem_(problem),
      space_(space),
      team_(team),
      reduction_(whole_reduction(team, part)),
      all_cells_(part != nullptr ? part->whole->cells : problem.cells),
      weights_(static_cast<std::size_t>(space.order) + 1),
      metrics_(problem.cells),
      values_(problem.cells) {
  const std::size_t numbers = static_cast<std::size_t>(space.place_count) * problem.dimension;
  if (room.size() < numbers) resize_large(own_room_, numbers);
  contributions_ = room.size() < numbers ? std::span(own_room_) : room.first(numbers);
  for (int s = 0; s <= space.order; ++s)
    weights_[static_cast<std::size_t>(s)] = std::pow(wave, 2 * (space.order + 1 - s));
  for (const CellSet& set : problem.sets) products_.push_back(&detail::part_products(set.shape, set.order));
  if (part != nullptr) cell_sum_.emplace(*part);
  take_frames();
}

void ModalForm::take_frames() {
  for_cells_together(problem_, team_,
                     [&](std::size_t set, std::int32_t first, std::int32_t count) { measure(set, first, count); });
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

/// The metrics.
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
    metrics_[cell] = {};
    if (transposed.determinant() == 0) continue;
    const Eigen::MatrixXd inverse = transposed.inverse(), metric = inverse.transpose() * inverse;
    for_pairs(d, [&](std::size_t pair, int a, int b) { metrics_[cell][pair] = metric(a, b); });
  }
}

std::array<double, 6> ModalForm::factors(std::size_t cell, std::size_t part) const {
  const int d = problem_.dimension;
  const double weight = weights_[part + 2];
  std::array<double, 6> result{};
  for_pairs(d,
            [&](std::size_t pair, int a, int b) { result[pair] = (a == b ? 1 : 2) * weight * metrics_[cell][pair]; });
  return result;
}

template <class Value>
void ModalForm::differentiate(const Value& value) {
  constexpr std::size_t kLanes = detail::kCellLanes;
  static_assert(at(kCellsTogether) == kLanes);
  change_kind_of_numbers();
  const std::size_t d = at(problem_.dimension);
  for_cells_together(problem_, team_, [&](std::size_t number, std::int32_t first, std::int32_t count) {
    const CellSet& set = problem_.sets[number];
    const detail::PartProducts& products = *products_[number];
    const std::size_t nodes = products.nodes;
    thread_local std::vector<double> x, room, slopes, weights;
    weights.clear();
    for (const int degree : products.degrees) weights.push_back(weights_[at(degree)]);
    x.assign(nodes * d * kLanes, 0.0);
    slopes.resize(x.size());
    const std::size_t cell = at(set.first) + at(first), place = at(space_.sets[number].first) + at(first) * nodes;
    std::array<double, 6 * kLanes> metrics{};
    std::array<double, kLanes> values;
    for (std::size_t i = 0; i < at(count); ++i) {
      for (std::size_t pair = 0; pair < products.pairs; ++pair) metrics[pair * kLanes + i] = metrics_[cell + i][pair];
      for (std::size_t n = 0; n < nodes; ++n)
        for (std::size_t k = 0; k < d; ++k) x[(n * d + k) * kLanes + i] = value(number, (at(first) + i) * nodes, n, k);
    }
    detail::differentiate_parts(products, weights.data(), metrics.data(), x.data(), room, values.data(), slopes.data());
    for (std::size_t i = 0; i < at(count); ++i) {
      values_[cell + i] = values[i];
      for (std::size_t n = 0; n < nodes * d; ++n)
        contributions_[(place + i * nodes) * d + n] = slopes[n * kLanes + i] / all_cells_;
    }
  });
}

double ModalForm::gradient(std::span<double> gradient) {
  const std::size_t d = static_cast<std::size_t>(problem_.dimension);
  differentiate([&](std::size_t set, std::size_t cell, std::size_t node, std::size_t k) {
    const std::int32_t* const nodes = problem_.sets[set].nodes.data() + cell;
    const auto x = [&](std::size_t n) { return problem_.positions[static_cast<std::size_t>(nodes[n]) * d + k]; };
    return x(node) - x(0);
  });
  add_up(problem_, space_, problem_.dimension, contributions_, gradient, team_);
  const double sum =
      cell_sum_ ? cell_sum_->sum(values_, reduction_, kCellsPerSum)
                : reduction_.sum(values_.size(), kCellsPerSum, [&](std::size_t cell) { return values_[cell]; });
  return sum / all_cells_;
}

void ModalForm::multiply(std::span<const double> direction, std::span<double> product) {
  const std::size_t d = static_cast<std::size_t>(problem_.dimension);
  differentiate([&](std::size_t set, std::size_t cell, std::size_t node, std::size_t k) {
    const std::int32_t number = space_.sets[set].numbers[cell + node];
    return number < 0 ? 0.0 : direction[static_cast<std::size_t>(number) * d + k];
  });
  add_up(problem_, space_, problem_.dimension, contributions_, product, team_);
}

std::vector<std::vector<double>> ModalForm::diagonals(std::span<const OrderSpace* const> spaces,
                                                      std::span<const double> stiffness) {
  const int d = problem_.dimension;
  change_kind_of_numbers();
  std::vector<std::vector<double>> result;
  for (std::size_t level = 0; level < spaces.size(); ++level) {
    const OrderSpace& space = *spaces[level];
    std::vector<double>& diagonal = result.emplace_back(space.count);
    const std::span<double> of_places = contributions_.first(static_cast<std::size_t>(space.place_count));
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
          sum += (a == b ? 1 : 2) * stiffness[cell] * metrics_[cell][pair] * squares.of_gradient[pair];
        });
        sum /= all_cells_;
        Eigen::Map<Eigen::VectorXd>(&of_places[static_cast<std::size_t>(space.sets[number].first) +
                                               static_cast<std::size_t>(first + i) * nodes],
                                    nodes) = sum;
      }
    });
    add_up(problem_, space, 1, of_places, diagonal, team_);
  }
  return result;
}

}  // namespace varimesh
