#include "core/optimise/on_geometry/optimise_on_geometry.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "core/base/stop_token.h"
#include "core/base/stopwatch.h"
#include "core/geometry/load.h"
#include "core/merit/merit.h"
#include "core/merit/thresholds.h"
#include "core/optimise/on_geometry/refine_on_model.h"
#include "core/optimise/on_geometry/run_on_geometry.h"

namespace varimesh {
namespace {

/// Of the time that is left: what a run takes at most if another may follow.
constexpr double kMostShare = 0.75;
/// The same if elements may be split afterwards, which takes a run for each round.
constexpr double kMostShareBeforeRefining = 0.5;
/// Of a limit of time: if the first run has taken no more, all nodes move together before elements are split.
constexpr double kShareOfFirst = 0.25;
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
        control_(control),
        hooks_(hooks),
        runs_(geometry_, model, watch, on_iteration, control, hooks) {
    geometry_.fix = options.fix;
    if (refines_) options_.repair = Repair::Report;  // until that leaves elements
  }

  Expected<ResultOnGeometry> run() {
    const bool is_only_run = geometry_.slide == SlideOn::None;
    auto first = run(mesh_, {geometry_.slide, refines_ ? kMostShareBeforeRefining : is_only_run ? 1 : kMostShare});
    if (!first) return tl::unexpected(first.error());
    best_.result = std::move(first->result);
    best_.slid = std::move(first->slid);
    is_unfinished_ = first->is_unfinished;
    const bool refines_in_time = refines_ && options_.time_limit > 0;
    // Refining adds elements, and may help sooner.
    const bool is_in_haste = refines_in_time && spent() > kShareOfFirst * options_.time_limit;
    if (!is_in_haste) move_together(refines_in_time ? kMostShareBeforeRefining : kMostShare);
    if (!refines_in_time) try_without_sliding();
    if (refines_ && left(best_.result) > 0 && may_be_split(mesh_)) {
      options_.repair = Repair::Split;
      split_inside();
      refine_in_stages();
      options_.repair = Repair::Report;  // more splits might exceed the bound on elements
    }
    if (is_in_haste) move_together(kMostShare);
    if (refines_in_time) try_without_sliding();
    finish();
    tell_of_refining();
    best_.result.stopped = best_.result.stopped || is_stopped_;
    best_.result.seconds = spent();
    best_.result.proof_seconds = runs_.proof_seconds();
    // Nodes have slid, so nobody need be told to let them.
    if (!is_only_run)
      std::erase_if(best_.result.left.remedies,
                    [](const Remedy& remedy) { return remedy.kind == Remedy::Kind::Slide; });
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

  /// Whether the mesh was optimised as it came. To slide once more would take no less time.
  bool is_cut_short() const { return !best_.slid || best_.slid->slid.is_cut_short; }

  /// Whether there are other ways than the first.
  bool has_other_ways() const { return geometry_.slide != SlideOn::None && !is_cut_short(); }

  void move_together(double share) {
    if (!has_other_ways() || geometry_.slide != SlideOn::Auto || geometry_.on_boundary() || mesh_.dimension != 3)
      return;
    if (is_weak(best_.result)) try_other(SlideOn::Coupled, left(best_.result) > 0 ? Asked() : kAskForMinimum, share);
  }
  void try_without_sliding() {
    if (!has_other_ways()) return;
    const double share = is_unfinished_ ? kMostShare : 1;
    if (geometry_.on_boundary()) return try_other(SlideOn::None, kAskForMinimum, share);
    if (left(best_.result) > 0) try_other(SlideOn::None, {}, share);
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
    auto other = run(mesh_, {slide, share});
    judge(other, asked, trial);
    tell(trial);
    if (trial.outcome == SlideTrial::Outcome::Taken) {
      tell_sentences(hooks_, other->slid, best_.slid);
      best_.result = std::move(other->result);
      best_.slid = std::move(other->slid);
      is_unfinished_ = other->is_unfinished;
      best_slide_ = slide;
      refinement_.reset();
      is_full_ = false;
    }
    best_.trials.push_back(std::move(trial));
  }

  void judge(const Expected<RunOnGeometry>& other, const Asked& asked, SlideTrial& trial) {
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
                     ? run(best_.result.mesh, {.share = kMostShareBeforeRefining, .is_curved = true})
                     : run(mesh_, {geometry_.slide, kMostShareBeforeRefining});
    if (!split || split->cut_short != StopToken::Reason::None) return false;
    is_stopped_ = split->result.stopped;
    if (is_stopped_ || !may_have(split->result.mesh) ||
        !is_better(merit_of(split->result.after), merit_of(best_.result.after)))
      return false;
    is_unfinished_ = split->is_unfinished;
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
      is_unfinished_ = other->is_unfinished;
      take_refined(best_, std::move(other->result), std::move(other->slid));
      refinement_ = refinement;
    }
    is_full_ = refinement.is_full || (is_full_ && round == 0);
  }

  /// Nothing if no edge may be split.
  std::optional<RunOnGeometry> refined_run(HighOrderMesh& mesh, SlideOn slide, const std::vector<std::int64_t>& wanted,
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
    auto done = run(mesh, {slide, kMostShare, true, most_distance_});
    return done ? std::optional(std::move(*done)) : std::nullopt;
  }

  /// Gives the best mesh the rest of the time if its run has left it unfinished. Its boundary stays, and nothing more
  /// is split.
  void finish() {
    if (!is_unfinished_ || is_ended()) return;
    if (!may_go_on()) return end_for_want_of_time();
    if (splits(options_.repair)) options_.repair = Repair::Report;
    auto last = run(best_.result.mesh, {.share = 1, .is_curved = true});
    if (last) is_stopped_ = last->result.stopped || last->cut_short == StopToken::Reason::Asked;
    if (last && last->cut_short == StopToken::Reason::TimeLimit) return end_for_want_of_time();
    if (!last || is_stopped_) return;
    Options resolved = options_;
    resolved.objective = objective_of(options_, best_.result.mesh.order);
    const Merit merit = merit_of(last->result.after), before = merit_of(best_.result.after);
    if (!is_better(merit, before, asked_by(resolved))) {  // the best mesh stays, and is no optimum
      const bool is_optimum = last->result.stop_reason == StopReason::Converged;
      best_.result.stop_reason = is_optimum ? StopReason::NoProgress : last->result.stop_reason;
      best_.result.converged = false;
      return;
    }
    // What was said about elements that are left is wrong if fewer are.
    std::vector<RepairStep> steps = is_better(merit, before) ? splits_of(best_.result.repairs) : best_.result.repairs;
    steps.insert(steps.end(), last->result.repairs.begin(), last->result.repairs.end());
    last->result.repairs = std::move(steps);
    take_refined(best_, std::move(last->result), std::move(last->slid));
  }

  /// The run of the best mesh was to leave its loss to a later run, which has no time.
  void end_for_want_of_time() {
    best_.result.stop_reason = StopReason::TimeLimit;
    best_.result.converged = false;
  }

  Expected<RunOnGeometry> run(HighOrderMesh mesh, const RunTask& task) {
    return runs_.run(std::move(mesh), options_, task);
  }
  double spent() const { return runs_.spent(); }
  int threads_to_slide() const { return runs_.threads_to_slide(options_); }
  void tell(const std::string& sentence) const { varimesh::tell(hooks_, sentence); }
  void tell(const SlideTrial& trial) const {
    if (hooks_.on_trial) hooks_.on_trial(trial);
  }

  const HighOrderMesh mesh_;  ///< As it came.
  Options options_;
  const bool refines_;
  GeometryOptions geometry_;
  const geometry::Geometry* model_;
  const RunControl& control_;
  const OnGeometryHooks& hooks_;
  RunsOnGeometry runs_;
  ResultOnGeometry best_;
  SlideOn best_slide_ = geometry_.slide;  ///< How its nodes have slid.
  double most_distance_ = 0;              ///< How far the boundary may lie in rounds of refining; 0: no round yet.
  bool is_unfinished_ = false;            ///< As RunOnGeometry::is_unfinished, of the best mesh.
  std::optional<Refinement> refinement_;  ///< What has refined the best mesh.
  bool is_full_ = false;                  ///< Refining would have split more, but the mesh may not grow so far.
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
