#include "core/slide/surface_alone.h"

#include <set>

#include "core/merit/merit.h"
#include "core/mesh/connectivity.h"
#include "core/quality/certified_quality.h"

namespace varimesh::detail {
namespace {

/// How good the elements of a surface are.
struct Judged {
  Merit merit;
  std::vector<double> of_element;  ///< Scaled Jacobians.
  std::set<std::int64_t> uncertified;

  Judged(const HighOrderMesh& mesh, const Team& team) {
    const QualityReport report = quality(mesh, 0, team);
    merit = merit_of(report);
    of_element = cell_quality(mesh, team).scaled_jacobian;
    for (const std::int64_t number : uncertified_numbers(report)) uncertified.insert(number);
  }
};

/// Fixes the nodes of the surfaces at fault. Returns whether a node was free before.
bool fix_surfaces_at_fault(const HighOrderMesh& mesh, const Association& association, const Judged& start,
                           const Judged& now, std::vector<bool>& fixed) {
  std::vector<bool> at_fault(association.surfaces.size(), false);
  std::size_t element = 0;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    if (reference::info(mesh.blocks[b].shape).dimension != 2) continue;
    for (std::size_t e = 0; e < mesh.blocks[b].size(); ++e) {
      const std::int64_t number = mesh.blocks[b].numbers[e];
      const int surface = association.surface_of_element[b][e];
      const bool lost = now.uncertified.contains(number) && !start.uncertified.contains(number);
      if (surface >= 0 && (lost || now.of_element[element] < start.merit.smallest))
        at_fault[static_cast<std::size_t>(surface)] = true;
      ++element;
    }
  }
  bool any = false;
  for (std::size_t s = 0; s < at_fault.size(); ++s)
    for (const std::int32_t node : association.surfaces[s].nodes) {
      if (!at_fault[s] || fixed[static_cast<std::size_t>(node)]) continue;
      fixed[static_cast<std::size_t>(node)] = true;
      any = true;
    }
  return any;
}

}  // namespace

SlideReport slide_alone(HighOrderMesh& mesh, Association& association, SlideOn what, std::vector<bool> fixed,
                        const Team& team) {
  const HighOrderMesh mesh_at_start = mesh;
  const Association association_at_start = association;
  const Judged start(mesh, team);
  while (true) {
    SlideReport report;
    team.run([&] { report = slide(mesh, association, what, fixed, team); });
    if (report.nodes == 0) return report;
    const Judged now(mesh, team);
    if (!is_better(start.merit, now.merit, kAskForMinimum)) return report;
    if (!fix_surfaces_at_fault(mesh, association, start, now, fixed)) fixed.assign(fixed.size(), true);
    mesh = mesh_at_start;
    association = association_at_start;
  }
}

}  // namespace varimesh::detail
