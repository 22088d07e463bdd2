#include "core/solvers/descent/on_device/levels_on_device.h"

#include <span>

#include "core/base/index.h"
#include "core/kernels/hessian/batch.h"
#include "core/solvers/descent/form/order_tables.h"
#include "core/solvers/descent/form/part_products.h"

namespace varimesh {
namespace {

/// The places of the nodes of an order in the matrices that are applied to them.
PlacesOfNodes places_of_nodes(const Problem& problem, int order) {
  PlacesOfNodes places;
  for (const CellSet& set : problem.sets)
    places.emplace_back(order < set.order
                            ? detail::order_tables(set.shape, set.order).raise[at(order - 1)].there.column_places
                            : detail::part_products(set.shape, set.order).to_modes.there.column_places);
  return places;
}

}  // namespace

LevelsOnDevice::LevelsOnDevice(device::Queue& queue, const device::Module* descent, const Problem& problem,
                               const OrderLevels& levels, CellValues& values, double* contributions,
                               device::Joiner& joiner, const Team& team)
    : queue_(queue),
      problem_(problem),
      source_(levels),
      values_(values),
      contributions_(contributions),
      joiner_(joiner),
      gather_values_(queue.kernel(descent, "gather_values")),
      add_up_residual_(queue.kernel(descent, "add_up_residual")),
      correct_(queue.kernel(descent, "correct")) {
  const std::span<const OrderSpace* const> spaces = levels.spaces();
  for (std::size_t q = 0; q < spaces.size(); ++q) {
    Level& level = levels_.emplace_back();
    level.space = copy_space(queue, problem, *spaces[q], places_of_nodes(problem, static_cast<int>(q) + 1), team);
    if (q + 1 == spaces.size()) break;
    const std::size_t bytes = at(spaces[q]->count) * at(problem.dimension) * sizeof(double);
    level.residual = queue.room(bytes);
    level.solution = queue.room(bytes);
    for (const CellSet& set : problem.sets) {
      const detail::LanePair& raise = detail::order_tables(set.shape, set.order).raise[q];
      level.there.push_back(copy_matrix(queue, raise.there));
      level.back.push_back(copy_matrix(queue, raise.back));
    }
  }
}

void LevelsOnDevice::take_diagonals() {
  for (std::size_t q = 0; q < levels_.size(); ++q) queue_.fill(levels_[q].inverse, source_.inverse_diagonals()[q]);
}

void LevelsOnDevice::multiply(const SpaceOnDevice& space, const double* vector, bool only_first,
                              const std::vector<MatrixOnDevice>& matrices, const SpaceOnDevice& to) {
  for (std::size_t number = 0; number < space.sets.size(); ++number) {
    const SpaceOnDevice::Set& set = space.sets[number];
    device::GatherArguments a;
    a.batches = set.batches;
    a.places = set.places;
    a.only_first = only_first ? 1 : 0;
    a.numbers = set.numbers.as<const std::int32_t>();
    a.vector = vector;
    a.to = values_.now();
    queue_.launch(gather_values_, std::int64_t{kBatch} * a.batches * a.places, a);
    values_.multiply_into(matrices[number], set.batches, contributions_ + to.sets[number].first * problem_.dimension);
  }
}

double LevelsOnDevice::apply(double* r, double* z) {
  const std::size_t last = levels_.size() - 1;
  for (std::size_t q = last; q-- > 0;) {
    const Level& level = levels_[q];
    const double* above = q + 1 == last ? r : levels_[q + 1].residual.as<const double>();
    // Each free node of the order above counts once.
    multiply(levels_[q + 1].space, above, true, level.back, level.space);
    device::OrderArguments a = level.space.arguments(contributions_);
    a.residual = level.residual.as<double>();
    queue_.launch(add_up_residual_, a.nodes, a);
  }
  double along = 0;
  for (std::size_t q = 0; q <= last; ++q) {
    const Level& level = levels_[q];
    if (q > 0)
      multiply(levels_[q - 1].space, levels_[q - 1].solution.as<const double>(), false, levels_[q - 1].there,
               level.space);
    device::OrderArguments a = level.space.arguments(q > 0 ? contributions_ : nullptr);
    a.inverse = level.inverse.as<const double>();
    a.residual = q == last ? r : level.residual.as<double>();
    a.solution = q == last ? z : level.solution.as<double>();
    a.parts = joiner_.parts(a.nodes);
    queue_.launch(correct_, a.nodes, a, device::kJoinBytes);
    if (q == last) along = joiner_.sum(a.nodes);
  }
  return along;
}

std::size_t LevelsOnDevice::memory() const {
  std::size_t bytes = 0;
  for (const Level& level : levels_) {
    bytes += level.space.memory() + level.inverse.bytes() + level.residual.bytes() + level.solution.bytes();
    for (const MatrixOnDevice& matrix : level.there) bytes += matrix.numbers.bytes();
    for (const MatrixOnDevice& matrix : level.back) bytes += matrix.numbers.bytes();
  }
  return bytes;
}

}  // namespace varimesh
