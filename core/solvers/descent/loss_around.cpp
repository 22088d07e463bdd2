#include "core/solvers/descent/loss_around.h"

#include <algorithm>
#include <atomic>

#include "core/reference/shape.h"

namespace varimesh {
namespace {

/// What is left of a value after a step. With .7 the energy holds more of the mesh, and the result near a body depends
/// more on what is far from it.
constexpr double kFade = 0.5;
constexpr int kMostSteps = 20;
constexpr std::int32_t kCellsPerTask = 4096;

/// Raises a number that several threads of the team may raise to `value`, if it is below it.
void raise_to(double& number, double value, const Team& team) {
  if (team.threads() == 1) {
    number = std::max(number, value);
    return;
  }
  std::atomic_ref shared(number);
  double seen = shared.load(std::memory_order_relaxed);
  while (seen < value && !shared.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
  }
}

}  // namespace

std::vector<double> loss_around(const Problem& problem, std::span<const double> values, const Team& team) {
  std::vector<double> around(values.begin(), values.end());
  std::vector<double> of_nodes(problem.positions.size() / problem.dimension);
  const auto for_cells = [&](const auto& use) {
    for (const CellSet& set : problem.sets)
      team.for_each(set.count, kCellsPerTask, [&, vertices = reference::info(set.shape).vertices](std::int32_t cell) {
        use(around[static_cast<std::size_t>(set.first) + cell],
            std::span(&set.nodes[static_cast<std::size_t>(cell) * set.nodes_per_cell], vertices));
      });
  };
  double least = around.empty() ? 0 : *std::ranges::max_element(around);
  std::atomic<bool> changes = true;
  for (int step = 0; step < kMostSteps; ++step) {
    least *= kFade;
    if (!changes) continue;
    changes = false;
    for_cells([&](double of_cell, std::span<const std::int32_t> vertices) {
      for (const std::int32_t node : vertices) raise_to(of_nodes[node], of_cell, team);
    });
    for_cells([&](double& of_cell, std::span<const std::int32_t> vertices) {
      for (const std::int32_t node : vertices) {
        if (of_cell >= kFade * of_nodes[node]) continue;
        of_cell = kFade * of_nodes[node];
        changes.store(true, std::memory_order_relaxed);
      }
    });
  }
  for (double& value : around) value = std::max(value, least);
  return around;
}

}  // namespace varimesh
