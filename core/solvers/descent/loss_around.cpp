#include "core/solvers/descent/loss_around.h"

#include <algorithm>

#include "core/reference/shape.h"

namespace varimesh {
namespace {

/// What is left of a value after a step. With .7 the energy holds more of the mesh, and the result near a body depends
/// more on what is far from it.
constexpr double kFade = 0.5;
constexpr int kMostSteps = 20;

}  // namespace

std::vector<double> loss_around(const Problem& problem, std::span<const double> values) {
  std::vector<double> around(values.begin(), values.end());
  std::vector<double> of_nodes(problem.positions.size() / problem.dimension);
  const auto for_vertices = [&](const auto& use) {
    for (const CellSet& set : problem.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell)
        for (int v = 0; v < reference::info(set.shape).vertices; ++v)
          use(around[static_cast<std::size_t>(set.first) + cell],
              of_nodes[set.nodes[static_cast<std::size_t>(cell) * set.nodes_per_cell + v]]);
  };
  double least = around.empty() ? 0 : *std::ranges::max_element(around);
  bool changes = true;
  for (int step = 0; step < kMostSteps; ++step) {
    least *= kFade;
    if (!changes) continue;
    changes = false;
    for_vertices([](double of_cell, double& of_node) { of_node = std::max(of_node, of_cell); });
    for_vertices([&](double& of_cell, double of_node) {
      if (of_cell >= kFade * of_node) return;
      of_cell = kFade * of_node;
      changes = true;
    });
  }
  for (double& value : around) value = std::max(value, least);
  return around;
}

}  // namespace varimesh
