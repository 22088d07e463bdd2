#include "core/optimise/on_geometry/refine_on_model.h"

#include <algorithm>
#include <limits>
#include <new>
#include <utility>

#include "core/association/association.h"
#include "core/association/match.h"
#include "core/association/plane/profile.h"
#include "core/base/counted.h"
#include "core/base/stop_token.h"
#include "core/base/team.h"
#include "core/mesh/node_parameters.h"
#include "core/mesh/plane.h"
#include "core/repair/boundary/boundary_swaps.h"
#include "core/repair/boundary/cusps.h"
#include "core/repair/boundary/refine.h"
#include "core/slide/on_file/slide_on_file.h"

namespace varimesh {
namespace {

/// In rounds of refining in which all nodes move together, the boundary may lie this many times as far from the model
/// as before. Without refining, the bound is the same if all nodes move together (core/slide/coupled).
constexpr double kTimesBefore = 2;
/// The least time for the search for cusps.
constexpr double kSeconds = 0.5, kSecondsPerCell = 2e-5;

/// If refining ends because the mesh may not have more elements than these.
std::string full_sentence(std::size_t most_cells) {
  return "Refining has ended because the mesh may have at most " + std::to_string(most_cells) +
         " elements; with a larger refine_growth it may go on.";
}

/// A space and a sentence, if the boundary of the refined mesh lies farther from the model than the boundary of the
/// mesh that came; else nothing.
std::string farther_sentence(const SlideReport& report) {
  if (!(report.after.largest > report.before.largest || report.after.rms > report.before.rms)) return "";
  return " The boundary may lie farther from the model now: by at most " + detail::number_text(report.after.largest) +
         ", and by " + detail::number_text(report.before.largest) +
         " before. Splits inside the mesh would leave the boundary where it is.";
}

/// What was done.
/// @param before, after  how many elements the mesh had, and has
std::string sentence_of(const Refinement& done, std::size_t before, std::size_t after) {
  constexpr std::size_t kShown = 10;
  std::string where;
  std::size_t shown = 0;
  for (const std::string& surface : done.surfaces) {
    if (shown == kShown) break;
    where += (shown++ == 0 ? (done.surfaces.size() == 1 ? " at surface " : " at surfaces ") : ", ") + surface;
  }
  if (done.surfaces.size() > kShown) where += " and " + std::to_string(done.surfaces.size() - kShown) + " more";
  const auto edges = [](std::size_t count) { return counted(static_cast<std::int64_t>(count), "edge"); };
  std::string what = done.edges > 0 ? "split " + edges(done.edges) : "";
  if (done.swapped > 0) what += (done.edges > 0 ? " and swapped " : "swapped ") + edges(done.swapped);
  const auto change = static_cast<std::int64_t>(after < before ? before - after : after - before);
  return "Refining " + what + where + " of the model; the mesh has " +
         counted(change, after < before ? "fewer element" : "more element") + " than the " + std::to_string(before) +
         " with which it came.";
}

}  // namespace

bool may_be_split(const HighOrderMesh& mesh) {
  const Shape simplex = mesh.dimension == 3 ? Shape::Tetrahedron : Shape::Triangle;
  return std::ranges::any_of(mesh.blocks, [&](const ElementBlock& block) { return block.shape == simplex; });
}

Expected<std::size_t> refine_on_model(HighOrderMesh& mesh, const GeometryOptions& options,
                                      const geometry::Geometry& model, const std::vector<std::int64_t>& wanted,
                                      std::size_t most_cells, Refinement& done) {
  auto held = nodes_of_groups(mesh, options.fix);
  if (!held) return tl::unexpected(held.error());
  Team team(options.threads);
  team.set_stop(options.stop);
  Expected<Association> association;
  HighOrderMesh refined = mesh;
  const NodesWithParameters before(mesh);
  RefineReport report;
  std::size_t swapped = 0;
  team.run([&] {
    association = lies_in_a_plane(mesh, team) ? associate_in_plane(mesh, model, team) : associate(mesh, model, team);
    if (!association) return;
    swapped = swap_boundary_edges(refined, *association, wanted, *held, done.steps, report.surfaces, team);
    if (swapped == 0) report = refine(refined, *association, {wanted, most_cells, std::move(*held)}, done.steps, team);
  });
  if (!association) return tl::unexpected(association.error());
  done.is_full = report.is_full;
  if (report.edges + swapped == 0) return 0;
  before.forget_moved(refined);
  mesh = std::move(refined);
  done.edges += report.edges;
  done.swapped += swapped;
  done.surfaces.insert(report.surfaces.begin(), report.surfaces.end());
  return report.edges + swapped;
}

std::vector<RepairStep> splits_of(std::vector<RepairStep> steps) {
  std::erase_if(steps, [](const RepairStep& step) { return step.kind == RepairStep::Kind::Left; });
  return steps;
}

void take_refined(ResultOnGeometry& best, Result&& other, std::optional<SlidAndMeasured>&& slid) {
  other.before = std::move(best.result.before);
  if (other.device.empty() && !best.result.device.empty()) {  // the other made no step on it, but the run has used it
    other.device = std::move(best.result.device);
    other.notes = std::move(best.result.notes);
  }
  if (slid && best.slid) {
    slid->slid.sentences = std::move(best.slid->slid.sentences);
    slid->slid.straight_elements = best.slid->slid.straight_elements;
    slid->slid.is_cut_short = best.slid->slid.is_cut_short;
    if (!best.slid->slid.is_cut_short) {  // otherwise nothing was measured before
      const SlideReport now = std::exchange(slid->slid.report, best.slid->slid.report);
      slid->slid.report.after = now.after;
      slid->slid.report.folded_after = now.folded_after;
    }
    best.slid = std::move(slid);
  }
  best.result = std::move(other);
}

std::string refining_sentence(const std::optional<Refinement>& done, const HighOrderMesh& came, const Result& best,
                              std::size_t full_at, const SlideReport* slid) {
  std::string text =
      done ? sentence_of(*done, came.element_count(came.dimension), best.mesh.element_count(came.dimension)) : "";
  if (full_at > 0) text += (text.empty() ? "" : " ") + full_sentence(full_at);
  if (!text.empty() && slid != nullptr) text += farther_sentence(*slid);
  return text;
}

std::string cusps_sentence(const Result& best, const geometry::Geometry* model, int threads, double seconds,
                           const std::function<bool()>& stop_asked) {
  std::vector<std::int64_t> left = uncertified_numbers(best.after);
  if (model == nullptr || left.empty() || best.mesh.dimension != 3) return "";
  std::ranges::sort(left);
  StopToken stop(stop_asked);
  const double least = kSeconds + kSecondsPerCell * static_cast<double>(best.mesh.element_count(3));
  if (seconds > 0) stop.stop_after(std::max(seconds, least));
  Team team(threads);
  team.set_stop(&stop);
  std::string sentence;
  try {
    team.run([&] {
      if (lies_in_a_plane(best.mesh, team)) return;
      if (auto association = associate(best.mesh, *model, team))
        sentence = cusps_sentence(cusps(best.mesh, *association, left));
    });
  } catch (const Interrupted&) {
  } catch (const std::bad_alloc&) {  // the mesh is worth more than the sentence
  }
  return sentence;
}

double most_distance_in_rounds(const SlideReport& slid) {
  // 0, on planes, would mean twice what each round finds.
  return std::max(kTimesBefore * std::max(slid.before.largest, slid.after.largest), std::numeric_limits<double>::min());
}

}  // namespace varimesh
