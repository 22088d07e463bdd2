#include "core/optimise/on_geometry/run_on_geometry.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "core/merit/merit.h"
#include "core/slide/on_file/slide_on_file.h"

namespace varimesh {
namespace {

/// Of the time of a run: what sliding takes at most.
constexpr double kMostToSlide = 0.75;

/// The optimisation does not know that boundary nodes have slid before it.
void forget_that_nothing_moved(std::vector<std::string>& notes) {
  constexpr std::string_view kNothing = "so nothing was moved", kMore = "so nothing was moved after nodes had slid";
  for (std::string& note : notes)
    if (const std::size_t at = note.find(kNothing); at != note.npos) note.replace(at, kNothing.size(), kMore);
}

}  // namespace

Expected<RunOnGeometry> RunsOnGeometry::run(HighOrderMesh mesh, Options options, const RunTask& task) {
  const bool is_limited = options.time_limit > 0;
  if (is_limited) options.time_limit = std::max(kNoTime, task.share * (options.time_limit - spent()));
  const bool slides = task.slide != SlideOn::None || !geometry_.on_boundary();
  RunOnGeometry run;
  const Stopwatch watch;
  if (slides) {
    const auto fine = slide(mesh, options, task, run);
    if (!fine) return tl::unexpected(fine.error());
    if (is_first_) tell_sentences(hooks_, run.slid, std::nullopt);
  }
  const double seconds = watch.seconds();
  if (is_limited) options.time_limit = std::max(kNoTime, options.time_limit - seconds);
  const auto numbered = [before = iterations_, begun = spent()](Iteration iteration) {
    iteration.number += before;
    iteration.seconds += begun;
    return iteration;
  };
  const OnIteration pass_on = [&](const Iteration& own) {
    Iteration iteration = numbered(own);
    iteration.seconds_left = left_of_all(own);
    if (control_.meter != nullptr) control_.meter->expect_end_in(iteration.seconds_left);
    return on_iteration_ ? on_iteration_(iteration) : Control::Continue;
  };
  RunControl control = checkpoints_.control_of_next(numbered, !slides || run.slid);
  control.another_follows = is_limited && task.share < 1;
  if (run.cut_short != StopToken::Reason::None && !is_first_) return run;
  auto result = optimise(std::move(mesh), options, pass_on, control);
  is_first_ = false;
  if (!result) return tl::unexpected(result.error());
  spent_ += seconds + result->seconds;
  proof_seconds_ += result->proof_seconds;
  iterations_ += result->iterations;
  run.result = std::move(*result);
  run.is_unfinished = control.another_follows &&
                      (merit_of(run.result.after).uncertified > 0 || run.result.stop_reason == StopReason::TimeLimit);
  if (run.slid && run.slid->slid.report.nodes > 0) forget_that_nothing_moved(run.result.notes);
  return run;
}

/// As Iteration::seconds_left, for all runs, from what a run says of itself. Nobody knows how many ways to slide will
/// be tried for elements that are left. On a boundary without a model, another run without sliding follows the first.
double RunsOnGeometry::left_of_all(const Iteration& own) const {
  if (own.seconds_left < 0 || (own.left_elements > 0 && !geometry_.on_boundary())) return -1;
  return own.seconds_left + (geometry_.on_boundary() && is_first_ ? own.seconds + own.seconds_left : 0);
}

int RunsOnGeometry::threads_to_slide(const Options& options) const {
  const auto& threads = hooks_.threads_to_slide ? hooks_.threads_to_slide : control_.threads;
  return threads ? threads() : options.threads;
}

/// Sets RunOnGeometry::slid, and `cut_short` if sliding was stopped. The mesh is then as it came or as it was curved,
/// and in the first run a sentence says so.
/// @param options  `time_limit` is that of this run
Expected<void> RunsOnGeometry::slide(HighOrderMesh& mesh, const Options& options, const RunTask& task,
                                     RunOnGeometry& run) const {
  StopToken stop(control_.stop_asked);
  if (options.time_limit > 0) stop.stop_after(kMostToSlide * options.time_limit);
  GeometryOptions geometry = geometry_;
  geometry.slide = task.slide;
  if (task.is_curved) {
    geometry.order = 0;
    geometry.snap = false;
    if (task.slide == SlideOn::Coupled && geometry.tolerance == 0) geometry.tolerance = task.most_distance;
  }
  geometry.coupled_seconds = options.time_limit / 2;
  geometry.threads = threads_to_slide(options);
  geometry.stop = &stop;
  try {
    auto slid = model_ != nullptr ? slide_and_measure(mesh, geometry, *model_)
                                  : slide_on_boundary(mesh, geometry).map([](SlidOnGeometry&& on_boundary) {
                                      return SlidAndMeasured{std::move(on_boundary), {}};
                                    });
    if (!slid) return tl::unexpected(slid.error());
    run.slid = std::move(*slid);
    if (run.slid->slid.is_cut_short) run.cut_short = stop.reason();
  } catch (const Interrupted&) {
    run.cut_short = stop.reason();
    const bool is_over = run.cut_short == StopToken::Reason::TimeLimit;
    if (is_first_)
      tell(hooks_, std::string(is_over ? "The time limit passed" : "The run was stopped") +
                       " while boundary nodes slid, so they are where they came.");
  }
  return {};
}

void tell_sentences(const OnGeometryHooks& hooks, const std::optional<SlidAndMeasured>& slid,
                    const std::optional<SlidAndMeasured>& before) {
  if (!slid) return;
  for (const std::string& sentence : slid->slid.sentences)
    if (!before || std::ranges::find(before->slid.sentences, sentence) == before->slid.sentences.end())
      tell(hooks, sentence);
}

void tell(const OnGeometryHooks& hooks, const std::string& sentence) {
  if (hooks.on_sentence) hooks.on_sentence(sentence);
}

}  // namespace varimesh
