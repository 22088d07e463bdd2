#include "core/maxmin/kept_raiser.h"

#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/problem/node_conversion.h"

namespace varimesh {
namespace {

/// Looks at cells per step: about a second's worth at order 3.
constexpr std::int64_t kLooksPerStep = 20'000;

}  // namespace

KeptRaiser::Outcome KeptRaiser::step() {
  guard_.return_to_kept();
  std::vector<bool> fixed(mesh_.node_count(), true);
  for (const std::int32_t node : problem_.free) fixed[at(node)] = false;
  const std::vector<double> kept = guard_.coordinates();
  std::vector<double> coordinates = kept;
  std::vector<Certificate> certificates = guard_.certificates();
  const RaiseTask task{mesh_, fixed, guard_.beyond_repair(), guard_.certifier(), 0};
  const RaiseOutcome raised = raise_low_cells(task, coordinates, certificates, team_, &memory_, kLooksPerStep);
  team_.look();
  Outcome outcome;
  outcome.tried = raised.patches > 0;
  outcome.finished = raised.finished;
  take(kept, coordinates, outcome);
  return outcome;
}

void KeptRaiser::take(const std::vector<double>& kept, const std::vector<double>& coordinates, Outcome& outcome) {
  const std::vector<double> positions =
      solver_positions(mesh_, coordinates, frame_of(mesh_, team_.without_stop()), team_.without_stop());
  // Only nodes of cells that have moved, so that rounding moves no others.
  std::vector<char> near(mesh_.node_count(), 0);
  for (const CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      const auto nodes = std::span(set.nodes).subspan(at(cell) * at(set.nodes_per_cell), at(set.nodes_per_cell));
      const bool moved = std::ranges::any_of(nodes, [&](std::int32_t node) {
        return !std::equal(&kept[3 * at(node)], &kept[3 * at(node)] + 3, &coordinates[3 * at(node)]);
      });
      for (const std::int32_t node : nodes) near[at(node)] = moved || near[at(node)] != 0 ? 1 : 0;
    }
  const auto d = at(problem_.dimension);
  for (std::size_t rank = 0; rank < problem_.free.size(); ++rank) {
    const auto node = at(problem_.free[rank]);
    if (near[node] == 0) continue;
    double square = 0;
    for (std::size_t k = 0; k < d; ++k) {
      double& position = problem_.positions[node * d + k];
      square += (positions[node * d + k] - position) * (positions[node * d + k] - position);
      position = positions[node * d + k];
    }
    outcome.residual = std::max(outcome.residual, std::sqrt(square) * double(problem_.inverse_size[rank]));
    ++outcome.active_nodes;
  }
}

}  // namespace varimesh
