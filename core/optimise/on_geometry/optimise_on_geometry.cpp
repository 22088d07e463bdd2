#include "core/optimise/on_geometry/optimise_on_geometry.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "core/base/stop_token.h"
#include "core/base/stopwatch.h"
#include "core/geometry/load.h"
#include "core/merit/merit.h"
#include "core/merit/thresholds.h"
#include "core/optimise/on_geometry/checkpoints_of_runs.h"
#include "core/optimise/on_geometry/refine_on_model.h"

namespace varimesh {
namespace {

/// Of the time that is left: what a run takes at most if another may follow.
constexpr double kMostShare = 0.75;
/// The same if elements may be split afterwards, which takes a run for each round.
constexpr double kMostShareBeforeRefining = 0.5;
/// Of the time of a run: what sliding takes at most.
constexpr double kMostToSlide = 0.75;
/// A limit of time that is over. 0 would mean no limit.
constexpr double kNoTime = 1e-9;
/// Rounds of refining: at most, and in a row without fewer elements that are left.
constexpr int kMostRounds = 12, kMostInVain = 3;

std::int64_t left(const Result& result) { return merit_of(result.after).uncertified; }
double smallest(const Result& result) { return merit_of(result.after).smallest; }
bool is_weak(const Result& result) { return left(result) > 0 || smallest(result) < threshold::kWeak; }

/// The runs on one mesh. What the constructor takes must outlive the object.
class Runs {
 public:
  /// @param watch  runs since the time limit began
  Runs(HighOrderMesh mesh, const Options& options, const GeometryOptions& geometry, const geometry::Geometry* model,
       const Stopwatch& watch, const OnIteration& on_iteration, const RunControl& control, const OnGeometryHooks& hooks)
      : mesh_(std::move(mesh)),
        options_(options),
        refines_(options.repair == Repair::Refine),
        geometry_(geometry),
        model_(model),
        on_iteration_(on_iteration),
        control_(control),
        hooks_(hooks),
        checkpoints_(control),
        watch_(watch),
        spent_(watch.seconds()) {
    geometry_.fix = options.fix;
    if (refines_) options_.repair = Repair::Report;  // until that leaves elements
  }

  Expected<ResultOnGeometry> run() {
    const bool is_only_run = geometry_.slide == SlideOn::None;
    auto first = run(mesh_, geometry_.slide, refines_ ? kMostShareBeforeRefining : is_only_run ? 1 : kMostShare);
    if (!first) return tl::unexpected(first.error());
    best_.result = std::move(first->result);
    best_.slid = std::move(first->slid);
    is_first_ = false;
    const bool is_in_haste = refines_ && options_.time_limit > 0;  // refining helps sooner, but adds elements
    if (!is_only_run && !is_in_haste) try_others();
    if (refines_ && left(best_.result) > 0 && may_be_split(mesh_)) {
      options_.repair = Repair::Split;
      split_inside();
      refine_in_stages();
      options_.repair = Repair::Report;  // more splits might exceed the bound on elements
    }
    if (!is_only_run && is_in_haste) try_others();
    tell_of_refining();
    best_.result.stopped = best_.result.stopped || is_stopped_;
    // Nodes have slid, so nobody need be told to let them.
    if (!is_only_run)
      std::erase_if(best_.result.left.remedies,
                    [](const Remedy& remedy) { return remedy.flags.starts_with("--slide-on"); });
    return std::move(best_);
  }

 private:
  /// What refining has done to the mesh that is taken, whether it might have gone on, and where the model leaves no
  /// room for the elements that are left.
  void tell_of_refining() {
    const bool is_full = is_full_ && left(best_.result) > 0;
    const SlideReport* slid = best_.slid ? &best_.slid->slid.report : nullptr;
    const double time_left = options_.time_limit > 0 ? std::max(kNoTime, options_.time_limit - spent()) : 0;
    for (const std::string& sentence :
         {refining_sentence(refinement_, mesh_, best_.result, is_full ? most_cells() : 0, slid),
          is_ended() ? "" : cusps_sentence(best_.result, model_, threads_to_slide(), time_left, control_.stop_asked)}) {
      if (sentence.empty()) continue;
      tell(sentence);
      if (best_.slid) best_.slid->slid.sentences.push_back(sentence);
    }
  }

  struct Run {
    Result result;
    std::optional<SlidAndMeasured> slid;
    /// Why no node has slid. A trial then has no result.
    StopToken::Reason cut_short = StopToken::Reason::None;
  };

  /// Of the time limit, in seconds. Runs that go on from a checkpoint have spent more than has passed since.
  double spent() const { return std::max(spent_, watch_.seconds()); }

  /// Whether the mesh was optimised as it came. To slide once more would take no less time.
  bool is_cut_short() const { return !best_.slid || best_.slid->slid.is_cut_short; }

  void try_others() {
    if (is_cut_short()) return;
    if (geometry_.on_boundary()) return try_other(SlideOn::None, kAskForMinimum, 1);
    if (is_weak(best_.result) && geometry_.slide == SlideOn::Auto && mesh_.dimension == 3)
      try_other(SlideOn::Coupled, left(best_.result) > 0 ? Asked() : kAskForMinimum, kMostShare);
    if (left(best_.result) > 0) try_other(SlideOn::None, {}, 1);
  }

  /// By the caller.
  bool is_ended() const {
    return best_.result.stopped || is_stopped_ || (control_.stop_asked && control_.stop_asked());
  }
  bool may_go_on() const { return !is_ended() && !(options_.time_limit > 0 && spent() >= options_.time_limit); }

  /// Takes another run if it is better.
  void try_other(SlideOn slide, const Asked& asked, double share) {
    if (!may_go_on()) return;
    SlideTrial trial;
    trial.slide = slide;
    trial.left_before = left(best_.result);
    trial.min_scaled_jacobian_before = smallest(best_.result);
    tell(trial);
    auto other = run(mesh_, slide, share);
    judge(other, asked, trial);
    tell(trial);
    if (trial.outcome == SlideTrial::Outcome::Taken) {
      tell_sentences(other->slid, best_.slid);
      best_.result = std::move(other->result);
      best_.slid = std::move(other->slid);
      best_slide_ = slide;
      refinement_.reset();
      is_full_ = false;
    }
    best_.trials.push_back(std::move(trial));
  }

  void judge(const Expected<Run>& other, const Asked& asked, SlideTrial& trial) {
    if (!other) {
      trial.outcome = SlideTrial::Outcome::Failed;
      trial.error = other.error().sentence;
      return;
    }
    if (other->cut_short == StopToken::Reason::TimeLimit) {
      trial.outcome = SlideTrial::Outcome::Failed;
      trial.error = "The time limit passed while boundary nodes slid.";
      return;
    }
    if (other->result.stopped || other->cut_short == StopToken::Reason::Asked) {
      trial.outcome = SlideTrial::Outcome::Stopped;
      is_stopped_ = true;
      return;
    }
    trial.left = left(other->result);
    trial.min_scaled_jacobian = smallest(other->result);
    trial.outcome = is_better(merit_of(other->result.after), merit_of(best_.result.after), asked)
                        ? SlideTrial::Outcome::Taken
                        : SlideTrial::Outcome::NoBetter;
  }

  /// How many elements the mesh may have. Splits inside count, too.
  std::size_t most_cells() const {
    return static_cast<std::size_t>(geometry_.growth * static_cast<double>(mesh_.element_count(mesh_.dimension)));
  }
  bool may_have(const HighOrderMesh& mesh) const { return mesh.element_count(mesh.dimension) <= most_cells(); }

  /// Splits edges and faces inside the mesh, which adds fewer elements where it helps. If all nodes have moved
  /// together, it goes on from there: few elements are left, and sliding anew would leave many. Returns whether this is
  /// taken.
  bool split_inside() {
    if (mesh_.dimension != 3 || !may_go_on()) return false;
    auto split = best_slide_ == SlideOn::Coupled || is_cut_short()
                     ? run(best_.result.mesh, SlideOn::None, kMostShareBeforeRefining, true)
                     : run(mesh_, geometry_.slide, kMostShareBeforeRefining);
    if (!split || split->cut_short != StopToken::Reason::None) return false;
    is_stopped_ = split->result.stopped;
    if (is_stopped_ || !may_have(split->result.mesh) ||
        !is_better(merit_of(split->result.after), merit_of(best_.result.after)))
      return false;
    take_refined(best_, std::move(split->result), std::move(split->slid));
    refinement_.reset();
    return true;
  }

  /// Where all nodes have moved together, the boundary bends to make room, which sliding would take away. So it stays
  /// at first. If this does not help, all nodes move together in each round, and at last boundary nodes slide.
  /// If sliding was cut short, the boundary stays in all rounds.
  void refine_in_stages() {
    if (is_cut_short()) return refine(SlideOn::None);
    const bool is_free = geometry_.slide == SlideOn::Auto || geometry_.slide == SlideOn::Coupled;
    const bool went_on = std::exchange(best_slide_, SlideOn::All) == SlideOn::Coupled;
    most_distance_ = most_distance_in_rounds(best_.slid->slid.report);
    refine(went_on ? SlideOn::None : is_free ? SlideOn::All : geometry_.slide);
    if (is_free && mesh_.dimension == 3) refine(SlideOn::Coupled);
    if (!went_on || left(best_.result) == 0) return;
    if (!refinement_) split_inside();
    refine(SlideOn::All);
  }

  /// Splits edges of the elements that are left, and optimises the mesh from there, round by round. Takes the best.
  /// @param slide  in each round
  void refine(SlideOn slide) {
    HighOrderMesh mesh = best_.result.mesh;
    Refinement refinement = refinement_.value_or(Refinement());
    refinement.is_full = false;
    refinement.steps = splits_of(best_.result.repairs);
    std::vector<std::int64_t> wanted = uncertified_numbers(best_.result.after);
    std::size_t fewest = wanted.size();
    int in_vain = 0;  // rounds since there were fewer
    int round = 0;
    for (; round < kMostRounds && in_vain < kMostInVain && !wanted.empty() && may_go_on(); ++round) {
      std::ranges::sort(wanted);
      auto other = refined_run(mesh, slide, wanted, refinement);
      if (other) is_stopped_ = other->result.stopped || other->cut_short == StopToken::Reason::Asked;
      if (!other || is_stopped_ || other->cut_short != StopToken::Reason::None) break;
      wanted = uncertified_numbers(other->result.after);
      in_vain = wanted.size() < fewest ? 0 : in_vain + 1;
      fewest = std::min(fewest, wanted.size());
      mesh = other->result.mesh;
      std::vector<RepairStep> all = refinement.steps;
      all.insert(all.end(), other->result.repairs.begin(), other->result.repairs.end());
      refinement.steps = splits_of(all);
      if (!may_have(mesh) || !is_better(merit_of(other->result.after), merit_of(best_.result.after))) continue;
      other->result.repairs = std::move(all);
      take_refined(best_, std::move(other->result), std::move(other->slid));
      refinement_ = refinement;
    }
    is_full_ = refinement.is_full || (is_full_ && round == 0);
  }

  /// Nothing if no edge may be split.
  std::optional<Run> refined_run(HighOrderMesh& mesh, SlideOn slide, const std::vector<std::int64_t>& wanted,
                                 Refinement& refinement) {
    StopToken stop(control_.stop_asked);
    if (options_.time_limit > 0) stop.stop_after(std::max(kNoTime, options_.time_limit - spent()));
    GeometryOptions geometry = geometry_;
    geometry.threads = threads_to_slide();
    geometry.stop = &stop;
    try {
      const auto split = refine_on_model(mesh, geometry, *model_, wanted, most_cells(), refinement);
      if (!split || *split == 0) return std::nullopt;
    } catch (const Interrupted&) {
      is_stopped_ = stop.reason() == StopToken::Reason::Asked;
      return std::nullopt;
    }
    auto done = run(mesh, slide, kMostShare, true);
    return done ? std::optional(std::move(*done)) : std::nullopt;
  }

  int threads_to_slide() const {
    const auto& threads = hooks_.threads_to_slide ? hooks_.threads_to_slide : control_.threads;
    return threads ? threads() : options_.threads;
  }

  /// Slides in this way and optimises the mesh.
  /// @param share      of the time that is left
  /// @param is_curved  the mesh comes from another run, so it is neither snapped nor curved
  Expected<Run> run(HighOrderMesh mesh, SlideOn slide, double share, bool is_curved = false) {
    Options options = options_;
    if (options.time_limit > 0) options.time_limit = std::max(kNoTime, share * (options.time_limit - spent()));
    const bool slides = slide != SlideOn::None || !geometry_.on_boundary();
    Run run;
    const Stopwatch watch;
    if (slides) {
      const auto fine = slide_nodes(mesh, slide, options.time_limit, is_curved, run);
      if (!fine) return tl::unexpected(fine.error());
      if (is_first_) tell_sentences(run.slid, std::nullopt);
    }
    const double seconds = watch.seconds();
    if (options.time_limit > 0) options.time_limit = std::max(kNoTime, options.time_limit - seconds);
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
    const RunControl control = checkpoints_.control_of_next(numbered, !slides || run.slid);
    if (run.cut_short != StopToken::Reason::None && !is_first_) return run;
    auto result = optimise(std::move(mesh), options, pass_on, control);
    if (!result) return tl::unexpected(result.error());
    spent_ += seconds + result->seconds;
    iterations_ += result->iterations;
    run.result = std::move(*result);
    if (run.slid && run.slid->slid.report.nodes > 0) forget_that_nothing_moved(run.result.notes);
    return run;
  }

  /// As Iteration::seconds_left, for all runs, from what a run says of itself. Nobody knows how many ways to slide will
  /// be tried for elements that are left. On a boundary without a model, another run without sliding follows the first.
  double left_of_all(const Iteration& own) const {
    if (own.seconds_left < 0 || (own.left_elements > 0 && !geometry_.on_boundary())) return -1;
    return own.seconds_left + (geometry_.on_boundary() && is_first_ ? own.seconds + own.seconds_left : 0);
  }

  /// The optimisation does not know that boundary nodes have slid before it.
  static void forget_that_nothing_moved(std::vector<std::string>& notes) {
    constexpr std::string_view kNothing = "so nothing was moved", kMore = "so nothing was moved after nodes had slid";
    for (std::string& note : notes)
      if (const std::size_t at = note.find(kNothing); at != note.npos) note.replace(at, kNothing.size(), kMore);
  }

  /// Sets Run::slid, and Run::cut_short if sliding was stopped. The mesh is then as it came or as it was curved, and in
  /// the first run a sentence says so.
  Expected<void> slide_nodes(HighOrderMesh& mesh, SlideOn slide, double limit, bool is_curved, Run& run) const {
    StopToken stop(control_.stop_asked);
    if (limit > 0) stop.stop_after(kMostToSlide * limit);
    GeometryOptions geometry = geometry_;
    geometry.slide = slide;
    if (is_curved) {
      geometry.order = 0;
      geometry.snap = false;
    }
    if (slide == SlideOn::Coupled && is_curved && geometry.tolerance == 0) geometry.tolerance = most_distance_;
    geometry.coupled_seconds = limit / 2;
    geometry.threads = threads_to_slide();
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
        tell(std::string(is_over ? "The time limit passed" : "The run was stopped") +
             " while boundary nodes slid, so they are where they came.");
    }
    return {};
  }

  /// Tells what came of sliding, without what was told for `before`.
  void tell_sentences(const std::optional<SlidAndMeasured>& slid, const std::optional<SlidAndMeasured>& before) const {
    if (!slid) return;
    for (const std::string& sentence : slid->slid.sentences)
      if (!before || std::ranges::find(before->slid.sentences, sentence) == before->slid.sentences.end())
        tell(sentence);
  }
  void tell(const std::string& sentence) const {
    if (hooks_.on_sentence) hooks_.on_sentence(sentence);
  }
  void tell(const SlideTrial& trial) const {
    if (hooks_.on_trial) hooks_.on_trial(trial);
  }

  const HighOrderMesh mesh_;  ///< As it came.
  Options options_;
  const bool refines_;
  GeometryOptions geometry_;
  const geometry::Geometry* model_;
  const OnIteration& on_iteration_;
  const RunControl& control_;
  const OnGeometryHooks& hooks_;
  CheckpointsOfRuns checkpoints_;
  ResultOnGeometry best_;
  SlideOn best_slide_ = geometry_.slide;  ///< How its nodes have slid.
  double most_distance_ = 0;              ///< How far the boundary may lie in rounds of refining; 0: no round yet.
  bool is_first_ = true;
  std::optional<Refinement> refinement_;  ///< What has refined the best mesh.
  bool is_full_ = false;                  ///< Refining would have split more, but the mesh may not grow so far.
  int iterations_ = 0;                    ///< Of all runs so far,
  const Stopwatch& watch_;                ///< and their seconds:
  double spent_;                          ///< those before them, and what they say themselves.
  bool is_stopped_ = false;               ///< A run after the first was stopped.
};

}  // namespace

Expected<ResultOnGeometry> optimise_on_geometry(HighOrderMesh mesh, const Options& options,
                                                const GeometryOptions& geometry, const geometry::Geometry* model,
                                                const OnIteration& on_iteration, const RunControl& control,
                                                const OnGeometryHooks& hooks) {
  if (auto fine = check(geometry); !fine) return tl::unexpected(fine.error());
  if (options.repair == Repair::Refine && geometry.on_boundary())
    return bad_option("repair is refine, which needs a model for its new nodes; choose split, or give a model.");
  const Stopwatch watch;
  Expected<geometry::Geometry> loaded;
  if (model == nullptr && !geometry.on_boundary()) {
    loaded = geometry::load(geometry.file);
    if (!loaded) return tl::unexpected(loaded.error());
    model = &*loaded;
  }
  return Runs(std::move(mesh), options, geometry, model, watch, on_iteration, control, hooks).run();
}

}  // namespace varimesh
