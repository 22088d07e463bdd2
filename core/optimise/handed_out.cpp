// Which mesh a run hands out: where it ended, part of the way there, or as it came.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "core/merit/merit.h"
#include "core/optimise/run.h"
#include "core/quality/certified_quality.h"

namespace varimesh {
namespace {

/// How far a mesh that loses in its layers may go towards the end of the run.
struct Share {
  double of_the_way;
  const char* name;
};
constexpr std::array kShares{Share{0.75, "three quarters"}, Share{0.5, "half"}, Share{0.25, "a quarter"}};

std::string pair_text(const QualityReport& report) {
  char text[64];
  std::snprintf(text, sizeof text, "%.3g and %.3g", report.min_scaled_jacobian, report.mean_scaled_jacobian);
  return text;
}

}  // namespace

bool Run::goes_part_of_the_way() {
  if (grace_.stopped()) return false;
  const std::vector<double>& came = set_up_.mesh.coordinates;
  std::vector<double>& now = result_.mesh.coordinates;
  const std::vector<double> end = now;
  for (const Share& share : kShares) {
    for (std::size_t i = 0; i < end.size(); ++i) now[i] = std::lerp(came[i], end[i], share.of_the_way);
    bool is_certified = false;
    const auto certify = [&] {
      team_.run([&] { certifier_->certify(now, certificates_, team_, sharers()); });
      is_certified = true;
    };
    grace_.finish(certify, [] {});
    if (!is_certified) break;
    if (!are_valid(certificates_)) continue;
    QualityReport report = judge(result_.mesh);
    if (!gains_without_loss(at_start_, report, options_)) continue;
    result_.after = std::move(report);
    if (std::exchange(result_.converged, false)) result_.stop_reason = StopReason::NoProgress;
    result_.notes.push_back("The nodes went " + std::string(share.name) +
                            " of the way to where the run ended, because there a solver's error in the layers at the "
                            "wall may be higher.");
    return true;
  }
  now = end;
  return false;
}

void Run::keep_the_better() {
  if (!came_valid()) {
    const Merit after = merit_of(result_.after), came = merit_of(at_start_);
    if (is_for_accuracy() && after.uncertified == came.uncertified && result_.repairs.empty() &&
        !keeps_loss(after, came))
      keep_as_it_came(
          "where the run ended, as many elements were not certified valid and its loss of accuracy was higher.");
    return;
  }
  // The descent chooses by the local loss.
  if (is_for_accuracy() && !keeps_loss(merit_of(result_.after), merit_of(at_start_)))
    keep_as_it_came("where the run ended, its loss of accuracy was not lower.");
  else if (is_for_accuracy() && loses_layers(at_start_, result_.after, options_) && !goes_part_of_the_way())
    keep_as_it_came(
        "where the run ended, the loss of accuracy was lower, but a solver's error in the layers at the wall may be "
        "higher.");
  if (options_.target != Target::StraightSided) return;
  QualityReport before = at_start_;
  if (before.lattice_intervals != result_.after.lattice_intervals)  // there was no time for the usual report
    before = quick_quality(set_up_.mesh, certificates_, team_);
  const bool lost_minimum =
      options_.objective == Objective::Worst && has_higher_minimum(merit_of(before), merit_of(result_.after));
  const Merit after = merit_of(result_.after), came = merit_of(before);
  if (!lost_minimum && !(is_for_accuracy() ? costs_shape(after, came) : is_lower(after, came))) return;
  const bool is_optimum = result_.converged && !is_for_accuracy();
  std::string why = "its smallest and its mean scaled Jacobian are " + pair_text(before) + ", and " +
                    (is_optimum ? "at the energy's optimum" : "where the run ended") + " they would be " +
                    pair_text(result_.after) + ".";
  if (options_.objective != Objective::Worst) why += " To raise the smallest, try the objective worst.";
  keep_as_it_came(why);
}

void Run::keep_as_it_came(std::string why) {
  if (set_up_.as_it_came.empty())
    result_.kept_as_it_came = "The mesh stays as it came: " + std::move(why);
  else
    result_.notes.push_back("Except for its layers, the mesh stays as it came: " + std::move(why));
  result_.mesh.coordinates = set_up_.mesh.coordinates;
  result_.after = at_start_;
}

}  // namespace varimesh
