#include "core/optimise/sequences/raise_left.h"

#include <algorithm>
#include <vector>

#include "core/base/team.h"
#include "core/diagnosis/elements_text.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/grace.h"
#include "core/problem/fixed_nodes.h"
#include "core/solvers/maxmin/raise.h"
#include "core/validity/certifier.h"

namespace varimesh {
namespace {

/// By cell: 1 if it is not one of these elements.
std::vector<char> all_but(const HighOrderMesh& mesh, std::span<const std::int64_t> numbers) {
  const Cells cells(mesh, mesh.dimension);
  std::vector<char> others(cells.count());
  for (std::size_t cell = 0; cell < others.size(); ++cell)
    others[cell] = std::ranges::binary_search(numbers, cells.number(cell)) ? 0 : 1;
  return others;
}

}  // namespace

void raise_left(Result& result, std::span<const std::int64_t> numbers, const Options& options, StopToken& stop) {
  const Expected<std::vector<bool>> fixed = choose_fixed_nodes(result.mesh, options);
  if (!fixed) return;
  Team team(options.threads);
  const Certifier certifier(result.mesh);
  std::vector<Certificate> certificates(certifier.cells());
  Grace grace(team, stop, certifier.cells());
  grace.watch();
  const std::vector<char> others = all_but(result.mesh, numbers);
  const RaiseTask task{result.mesh, *fixed, others, certifier};
  const std::vector<double> as_it_was = result.mesh.coordinates;
  RaiseOutcome outcome;
  try {
    team.run([&] {
      certifier.certify(result.mesh.coordinates, certificates, team);
      outcome = raise_low_cells(task, result.mesh.coordinates, certificates, team);
    });
  } catch (const Interrupted&) {  // before anything has moved
    return;
  }
  if (outcome.made_valid.empty()) {
    result.mesh.coordinates = as_it_was;
    return;
  }
  result.after = report_quality(result.mesh, certifier, certificates, team, grace);
  result.notes.push_back("After the splits, " + elements_text(outcome.made_valid, "element", "elements") +
                         (outcome.made_valid.size() == 1 ? " was" : " were") + " made valid in small patches.");
}

}  // namespace varimesh
