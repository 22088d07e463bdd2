#include "core/optimise/run.h"

#include <algorithm>
#include <utility>

#include "core/diagnosis/diagnose.h"
#include "core/diagnosis/elements_text.h"
#include "core/merit/thresholds.h"
#include "core/mesh/changes/straight_sides.h"
#include "core/problem/node_conversion.h"
#include "core/quality/accuracy/accuracy.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/quality/certified_quality.h"
#include "core/repair/straighten.h"

namespace varimesh {
namespace {

std::unique_ptr<JudgeOnDevice> make_judge(device::RunDevice* device, int dimension) {
  if (device == nullptr || device->get() == nullptr) return nullptr;
  return std::make_unique<JudgeOnDevice>(*device, dimension);
}

std::unique_ptr<const Certifier> make_certifier(const HighOrderMesh& mesh, JudgeOnDevice* judge, const Team& team) {
  std::unique_ptr<Certifier> certifier;
  team.run([&] { certifier = std::make_unique<Certifier>(mesh, CertificateOptions{}, team); });
  certifier->measure_with(judge);
  return certifier;
}

/// A copy of the mesh with other coordinates. Those of the mesh, its largest array, are not copied.
HighOrderMesh with_coordinates(HighOrderMesh& mesh, std::vector<double> coordinates) {
  std::vector<double> kept = std::move(mesh.coordinates);
  HighOrderMesh copy = mesh;
  mesh.coordinates = std::move(kept);
  copy.coordinates = std::move(coordinates);
  return copy;
}

/// What was done about layers.
std::string layers_text(const LayerStart& layers, LayerSpacing spacing) {
  const auto elements = [](std::int64_t count) {
    return std::to_string(count) + (count == 1 ? " element" : " elements");
  };
  std::string text = elements(layers.cells) + (layers.cells == 1 ? " lies" : " lie") + " in layers along a " +
                     (spacing == LayerSpacing::Keep ? "curved wall. " : "wall. ");
  if (layers.placed > 0)
    text += "The nodes of " + std::to_string(layers.placed) + " of them were placed on surfaces parallel to the wall" +
            (spacing == LayerSpacing::Keep   ? ". "
             : spacing == LayerSpacing::Even ? ", evenly spaced in each. "
                                             : ", with a spacing that grows with the layers. ");
  return text + (layers.held.empty() ? "Elements are left to be repaired, so all nodes may move."
                                     : "Nodes that lie on such surfaces stay.");
}

constexpr int kMostDescents = 6;

}  // namespace

Run::Run(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop)
    : set_up_(set_up),
      options_(set_up.options),
      on_iteration_(on_iteration),
      control_(control),
      watch_(Stopwatch::started(std::exchange(set_up.seconds, 0))),
      team_(control.threads ? control.threads() : options_.threads),
      judge_(make_judge(control.device, set_up.mesh.dimension)),
      certifier_(make_certifier(set_up.mesh, judge_.get(), team_)),
      certificates_(certifier_->cells()),
      grace_(team_, stop, certifier_->cells(), sharers()) {
  if (control.ranks != nullptr) of_ranks_.emplace(*control.ranks);
}

Result Run::go() {
  if (control_.checkpoint.empty()) grace_.watch();
  result_.sizes = set_up_.summary;
  const double began = watch_.seconds();
  judge_as_it_came();
  if (control_.forecast != nullptr) control_.forecast->judged_in(watch_.seconds() - began);
  result_.seconds = watch_.seconds();
  const bool iterates = options_.max_iterations > 0 && !has_no_free_node() && !grace_.stopped();
  if (iterates) run_stages();
  const Stopwatch after_stages;
  const bool is_placed = !set_up_.as_it_came.empty();  // layers were brought into form, so the mesh has changed
  const std::string unmoved = grace_.stopped() || is_placed ? "" : why_unmoved();
  if (!iterates && is_placed) {
    result_.mesh.coordinates = set_up_.mesh.coordinates;
    note_no_free_node();
  }
  if (!is_placed && (!iterates || !unmoved.empty())) {
    take_as_it_came(unmoved);
    if (grace_.stopped()) grace_.say_stopped(result_);
  } else {
    finish_mesh();
    result_.seconds += after_stages.seconds();
  }
  return std::move(result_);
}

void Run::judge_as_it_came() {
  std::vector<double>& coordinates = set_up_.mesh.coordinates;
  const auto prove_it = [&] {
    const Stopwatch watch;
    grace_.finish([&] { prove(); }, [] {});
    result_.proof_seconds += watch.seconds();
  };
  const auto swap_layers = [&] {
    if (!set_up_.as_it_came.empty()) coordinates.swap(set_up_.as_it_came);
  };
  swap_layers();
  prove_it();
  result_.before = judge(set_up_.mesh);
  swap_layers();
  if (!set_up_.as_it_came.empty()) prove_it();
  at_start_ = !set_up_.as_it_came.empty() && options_.layer_spacing != LayerSpacing::Keep ? judge(set_up_.mesh)
                                                                                          : result_.before;
  const bool looked = options_.max_iterations > 0;
  if (looked && options_.layer_spacing != LayerSpacing::Keep && set_up_.layers.cells == 0)
    result_.notes.emplace_back("There are no layers of thin elements at a wall, so layer_spacing changes nothing.");
  if (!set_up_.layers.held.empty() || set_up_.layers.placed > 0)
    result_.notes.push_back(layers_text(set_up_.layers, options_.layer_spacing));
}

QualityReport Run::judge(const HighOrderMesh& mesh) {
  QualityReport report = report_quality(mesh, *certifier_, certificates_, team_, grace_, samples());
  if (set_up_.layers.cells == 0) return report;
  grace_.finish([&] { report.in_layers = layer_error(mesh, set_up_.facets, team_, &set_up_.mesh); }, [] {});
  // Processors differ in the last digit of exp, and what the run does next depends on these numbers.
  if (report.in_layers) {
    sharers().largest(report.in_layers->of_profiles);
    report.in_layers->error = sharers().largest(report.in_layers->error);
  }
  return report;
}

void Run::prove() {
  team_.run([&] {
    certifier_->certify(set_up_.mesh.coordinates, certificates_, team_, sharers());
    if (!are_valid(certificates_)) result_.unrepairable = diagnose(set_up_.mesh, set_up_.fixed, team_);
  });
}

std::string Run::why_unmoved() {
  const HighOrderMesh& mesh = set_up_.mesh;
  if (set_up_.summary.free_nodes == 0)
    return "No node is free, so nothing was moved: all lie on the boundary or are fixed by the options. A higher order "
           "gives elements inner nodes, and the option free frees interfaces.";
  if (has_no_free_node()) return "All nodes lie on surfaces parallel to a wall already, so nothing was moved.";
  if (result_.iterations == 0 && result_.stop_reason == StopReason::Valid)
    return "Every element is certified valid already, so nothing was moved.";
  if (result_.iterations == 0 && result_.stop_reason == StopReason::Quality)
    return "Every element has the scaled Jacobian that until_js names already, so nothing was moved.";
  const bool is_same = is_for_accuracy() ? result_.mesh.coordinates == mesh.coordinates : result_.iterations == 1;
  if (!is_same || !result_.converged || !came_valid()) return "";
  bool straight = options_.target == Target::StraightSided;
  team_.run([&] { straight = straight && has_straight_sides(mesh, team_.without_stop()); });
  if (straight)
    return std::string("All elements have straight sides already, so nothing was moved. ") +
           (mesh.dimension == 3 ? "To curve them, curve the mesh on its CAD model. " : "") +
           "The target ideal makes their shapes more regular.";
  if (is_for_accuracy() && result_.iterations == 0)
    return "The curvature of these elements costs a solver next to nothing beside what their size costs, so nothing "
           "was moved.";
  if (is_for_accuracy())
    return "No mesh with a lower loss of accuracy was found that is worth the change, so nothing was moved.";
  return "The mesh is at its optimum already: no node would move by more than the tolerance, so nothing was moved.";
}

void Run::take_as_it_came(const std::string& why) {
  result_.mesh = set_up_.mesh;
  result_.after = result_.before;
  if (!why.empty()) result_.notes.push_back(why);
  note_no_free_node();
}

void Run::note_no_free_node() {
  if (!has_no_free_node() || options_.max_iterations == 0) return;
  result_.converged = true;  // there is no free node that could be far from the optimum
  result_.stop_reason = StopReason::Converged;
}

// ===== after the stages =====

void Run::finish_mesh() {
  result_.mesh = with_coordinates(set_up_.mesh, std::move(result_.mesh.coordinates));
  if (options_.method == Method::Auto && control_.untangles_lost && !was_cut_short(result_)) raise_low();
  if (options_.repair == Repair::Straighten && !result_.unrepairable.empty()) straighten_result();
  result_.after = judge(result_.mesh);
  keep_the_better();
}

void Run::show_mesh() {
  if (!control_.mesh_wanted || !control_.mesh_wanted()) return;
  HighOrderMesh mesh = with_coordinates(set_up_.mesh, guard_->latest_coordinates());
  const CellQuality quality = cell_quality(mesh, team_.without_stop());
  control_.show_mesh({mesh, quality.scaled_jacobian, guard_->latest_certificates()});
}

void Run::raise_low() {
  const std::vector<char> hopeless = cells_beyond_repair(result_.unrepairable, certificates_.size());
  const std::vector<double> coordinates = result_.mesh.coordinates;
  const std::vector<Certificate> before = certificates_;
  RaiseOutcome outcome;
  const auto raise_to = [&](double aim) {
    const RaiseTask task{result_.mesh, set_up_.fixed, hopeless, *certifier_, aim};
    team_.run([&] {
      forget_changed_cells(task, result_.mesh.coordinates, certificates_, team_.without_stop(), raised_);
      outcome = raise_low_cells(task, result_.mesh.coordinates, certificates_, team_, &raised_);
    });
  };
  if (!are_valid(certificates_)) raise_to(0);
  const std::vector<std::int64_t> made_valid = std::move(outcome.made_valid);
  const Asked asked = asked_by(options_);
  if (asked.what == Asked::What::Loss && !outcome.interrupted && are_valid(certificates_)) raise_to(asked.bound);
  if (outcome.interrupted) grace_.say_stopped(result_);
  if (made_valid.empty() && outcome.raised.empty()) return;
  const auto loss_at = [&](const std::vector<double>& at) {
    return Merit{.loss = local_loss(set_up_.mesh, at, team_.without_stop(), sharers())};
  };
  if (came_valid() && !keeps_loss(loss_at(result_.mesh.coordinates), loss_at(set_up_.mesh.coordinates))) {
    result_.mesh.coordinates = coordinates;
    certificates_ = before;
    return;
  }
  result_.made_valid_at_end = static_cast<std::int64_t>(made_valid.size());
  if (!made_valid.empty())
    result_.notes.push_back("At the end of the run, " + elements_text(made_valid, "element", "elements") +
                            (made_valid.size() == 1 ? " was" : " were") + " made valid in small patches.");
  if (!outcome.raised.empty())
    result_.notes.push_back("At the end of the run, the scaled Jacobian of " +
                            elements_text(outcome.raised, "element", "elements") + " was raised in small patches.");
}

void Run::straighten_result() {
  const auto straighten_all = [&] {
    team_.run([&] {
      result_.repairs =
          straighten(result_.mesh, set_up_.fixed, *certifier_, certificates_, result_.unrepairable, team_);
    });
  };
  grace_.finish(straighten_all, [&] {
    RepairStep left;
    left.sentence = "The run was stopped before it could make elements straight-sided; run it again with more time.";
    result_.repairs.push_back(std::move(left));
  });
}

bool was_cut_short(const RunSummary& result) {
  return result.stop_reason == StopReason::TimeLimit || result.stop_reason == StopReason::Iterations ||
         result.stop_reason == StopReason::Stopped;
}

// ===== the descents to the least loss of accuracy =====

DescentContext Run::descent_context() {
  return {set_up_.mesh,
          set_up_.problem,
          *set_up_.stages[0].kernels,
          *set_up_.stages[0].hessian,
          material(options_),
          *guard_,
          *certifier_,
          team_,
          asked_by(options_),
          came_valid() || descents_ > 0,
          came_valid() && options_.target == Target::StraightSided ? &at_start_ : nullptr,
          {},
          control_.meter,
          control_.device,
          samples(),
          control_.ranks};
}

bool Run::begin_descent() {
  if (descent_) return true;
  team_.run([&] {
    stage_run_->free_methods();
    descent_.emplace(descent_context());
  });
  if (descent_->begin()) return true;
  if (descent_->best().merit.uncertified > 0) result_.notes.emplace_back(Descent::kNotWorthIt);
  return false;
}

void Run::lower_loss() {
  const bool begins = begin_descent();
  if (begins || descent_->has_converged()) result_.stop_reason = StopReason::Converged;
  bool last = !begins;
  do {
    descend(last);
  } while (descends_again(last));
  if (begins && result_.stop_reason == StopReason::Converged && !descent_->has_converged())
    result_.stop_reason = StopReason::NoProgress;
  result_.converged = result_.stop_reason == StopReason::Converged;
  note_last_iteration();
}

void Run::descend(bool last) {
  const auto may_go_on = [&] {
    if (!last && stage_run_->last().number >= options_.max_iterations) result_.stop_reason = StopReason::Iterations;
    return !last && result_.stop_reason == StopReason::Converged;
  };
  const std::uint64_t fingerprint = fingerprint_of_stage();
  if (control_.forecast != nullptr) control_.forecast->descent(stage_run_->seconds());
  while (may_go_on()) {
    team_.look_together();
    if (control_.threads) team_.set_threads(control_.threads());
    const DescentRound round = descent_->round();
    last = round.last;
    stage_run_->add(round);
    forecast(round);
    if (!last && descents_ == 0 && control_.checkpoint_due && control_.checkpoint_due(stage_run_->last()))
      control_.save_checkpoint(stage_run_->last(), [&](const CheckpointSink& sink) {
        return stage_run_->write(sink, fingerprint, [this](CheckpointWriter& writer) { descent_->write(writer); });
      });
    result_.stopped = on_iteration_ && on_iteration_(stage_run_->last()) == Control::Stop;
    show_mesh();
    if (!result_.stopped) continue;
    result_.stop_reason = StopReason::Stopped;
    break;
  }
}

bool Run::is_worth_another_descent() const {
  const bool has_old_targets = !came_valid() && descents_ == 0 && descent_->best().merit.uncertified == 0;
  return options_.target == Target::StraightSided && (descent_->has_gained() || has_old_targets || begins_weighted_) &&
         descents_ + 1 < kMostDescents;
}

bool Run::descends_again(bool& last) {
  if (result_.stop_reason != StopReason::Converged || !is_worth_another_descent()) return false;
  // What low cells have needed is kept, so that it need not be found again. If that leads little further, the next
  // descent begins without it, as another run would: the weight may hold cells that are not low any more.
  retries_ = begins_weighted_ && descent_->gain() < threshold::kGainWithWeights;
  most_accurate_ = descent_->take_best();
  std::vector<double> factors = retries_ ? std::vector<double>() : descent_->factors();
  begins_weighted_ = std::ranges::any_of(factors, [](double factor) { return factor > 1; });
  descent_.reset();
  // From here on, an interrupted run has no guard until there is one for the new targets (finish_stages).
  result_.proof_seconds += guard_->seconds();
  guard_.reset();
  std::vector<double> before = std::exchange(set_up_.mesh.coordinates, std::move(most_accurate_.coordinates));
  if (++descents_ == 1) before_descents_ = std::move(before);
  team_.run([&] { set_up_.problem.positions = solver_positions(set_up_.mesh, frame_, team_); });
  choose_targets(set_up_, *certifier_, frame_, team_);
  team_.run([&] {
    guard_.emplace(set_up_.mesh, frame_, set_up_.problem, *certifier_, most_accurate_.certificates, team_, sharers());
    DescentContext context = descent_context();
    context.factors = std::move(factors);
    descent_.emplace(context);
  });
  last = !descent_->begin();
  return true;
}

}  // namespace varimesh
