#include "core/solvers/maxmin/kept_raiser.h"

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
  const std::vector<bool> fixed = this->fixed();
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

bool KeptRaiser::raise_lost(double aim, std::int64_t most_looks) {
  const std::vector<bool> fixed = this->fixed();
  const std::vector<double> latest = guard_.latest_coordinates();
  std::vector<double> coordinates = latest;
  std::vector<Certificate> certificates = guard_.latest_certificates();
  std::vector<char> others(certificates.size());
  for (std::size_t cell = 0; cell < others.size(); ++cell)
    others[cell] = guard_.certificates()[cell].is_valid() ? 0 : 1;
  RaiseMemory memory;
  raise_low_cells({mesh_, fixed, others, guard_.certifier(), aim}, coordinates, certificates, team_, &memory,
                  most_looks);
  team_.look();
  Outcome outcome;
  take(latest, coordinates, outcome);
  return outcome.active_nodes > 0;
}

std::vector<bool> KeptRaiser::fixed() const {
  std::vector<bool> result(mesh_.node_count(), true);
  for (const std::int32_t node : problem_.free) result[at(node)] = false;
  return result;
}

void KeptRaiser::take(const std::vector<double>& from, const std::vector<double>& to, Outcome& outcome) {
  const std::vector<double> positions =
      solver_positions(mesh_, to, frame_of(mesh_, team_.without_stop()), team_.without_stop());
  // Only nodes of cells that have moved, so that rounding moves no others.
  std::vector<char> near(mesh_.node_count(), 0);
  for (const CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      const auto nodes = std::span(set.nodes).subspan(at(cell) * at(set.nodes_per_cell), at(set.nodes_per_cell));
      const bool moved = std::ranges::any_of(nodes, [&](std::int32_t node) {
        return !std::equal(&from[3 * at(node)], &from[3 * at(node)] + 3, &to[3 * at(node)]);
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
