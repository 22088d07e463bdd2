#include "core/solvers/descent/descent.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/index.h"
#include "core/base/reduction.h"
#include "core/base/shared_work.h"
#include "core/kernels/p_norm.h"
#include "core/merit/thresholds.h"
#include "core/problem/node_conversion.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/quality/certified_quality.h"
#include "core/solvers/descent/has_loss.h"
#include "core/solvers/descent/loss_around.h"
#include "core/solvers/descent/on_device/device_loss.h"
#include "core/solvers/maxmin/kept_raiser.h"

namespace varimesh {
namespace {

/// ε_e is the squared loss around times this.
constexpr double kWeight = 1;
/// How much vertices are held beside the energy.
constexpr double kHold = 10;
constexpr double kRaise = 4;
constexpr int kMostRaises = 8;
/// If the bound on the scaled Jacobian is in reach (threshold::kInReach), more rounds are worth it: in thin prisms of
/// order 2 the loss falls to .4 of what it is after kMostRaises.
constexpr int kMostRaisesInReach = 20;
/// Once cells that lost their certificate are raised, this many looks at cells a round (raise.h).
constexpr std::int64_t kLooksPerRound = 20'000;
/// A round that raises the loss by more than threshold::kRises, and the minimum of the scaled Jacobian not at all, has
/// left what the frames at its beginning say. It is taken back, and ε_e gets this many times as large.
constexpr double kCaution = 10;
/// More weight for low cells is given again if it has raised the minimum by this.
constexpr double kWorthMore = 0.01;
constexpr int kMostSettling = 12;  ///< Rounds that change no factor.
constexpr std::int32_t kCellsPerTask = 4096;

/// The scans saw the step. Where cells have gone back after it, the mesh has what is proved of it, which no scan is
/// below.
void show_kept(DescentRound& round, double proved) {
  round.min_scaled_jacobian = std::max(round.min_scaled_jacobian, proved);
}

}  // namespace

Descent::Descent(const DescentContext& context)
    : context_(context),
      problem_(context.problem),
      team_(context.team),
      part_(context.ranks != nullptr ? std::optional(part_of(problem_, *context.ranks)) : std::nullopt),
      scans_(part_ ? at(problem_.cells) : 0),
      own_(part_ ? part_->problem : problem_),
      from_(free_positions(own_, own_.positions, team_)),
      space_(own_space(own_, team_, part())),
      barrier_(own_, context.kernels, context.hessian, PNorm{}, team_, part_ ? &part_->share : nullptr),
      form_(own_, space_, local_wave(context.mesh), team_, barrier_.room(), part()),
      levels_(own_, space_, team_, part()),
      objective_(own_, barrier_, form_, levels_, context.material, team_, part()),
      factors_(context.factors.empty() ? std::vector<double>(problem_.cells, 1.0) : context.factors),
      weights_(own_.cells),
      lost_(problem_.cells, 0),
      uncertified_(problem_.cells, 0),
      asked_(context.asked),
      earlier_minima_(kRoundsOfPace, -std::numeric_limits<double>::infinity()) {
  barrier_.weigh(weights_, problem_.cells);
  barrier_.count_with(context.meter, point_operations(context.material, problem_.dimension));
  const std::vector<Standing> standings = context.guard.standings();
  for (CellSet& set : problem_.sets)
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
      if (standings[set.first + cell] == Standing::Valid) set.delta_squared[cell] = 0;
    });
}

bool Descent::begin() {
  State kept = kept_state();
  last_loss_ = kept.merit.loss;
  accept(kept);
  const bool as_it_came = kept.coordinates == context_.mesh.coordinates;
  kept.merit.lower_than_it_came = kept.merit.lower_than_it_came && !as_it_came;
  if (is_acceptable(kept)) asked_.least_loss = kept.merit.loss;
  if (!as_it_came) {
    // The energy came first (phases.h). It may have raised the loss, which must not stay so unless it certified cells.
    State came = state_as_it_came();
    if (context_.came_valid || !is_better(kept.merit, came.merit)) {
      start_from(std::move(came));
      if (is_better(kept.merit, best_.merit, asked_)) best_ = std::move(kept);
      return !stays_invalid_for_size();
    }
  }
  start_from(std::move(kept));
  return start_loss_ > 0 && !stays_invalid_for_size() &&
         !(as_it_came && reaches_bound(best_) && !has_loss(context_.mesh, best_.merit.smallest, team_, sharers()));
}

void Descent::start_from(State state) {
  best_ = std::move(state);
  start_loss_ = best_.merit.loss;
  if (context_.came_valid) asked_.loss_as_it_came = start_loss_;
}

bool Descent::stays_invalid_for_size() const {
  return best_.merit.uncertified > 0 && size_decides(context_.mesh, best_.coordinates, team_, sharers());
}

Descent::State Descent::kept_state() const {
  State state = judged_kept_state();
  team_.run([&] { context_.guard.copy_coordinates(state.coordinates); });
  return state;
}

Descent::State Descent::judged_kept_state() const {
  State state;
  std::vector<double> copy;
  std::span<const double> coordinates = context_.guard.coordinates_in_place();
  team_.run([&] {
    if (coordinates.empty()) {
      context_.guard.copy_coordinates(copy);
      coordinates = copy;
    }
    state.certificates = context_.guard.certificates();
    judge(coordinates, state);
  });
  state.merit.loss = local_loss(context_.mesh, coordinates, team_, sharers());
  state.merit.lower_than_it_came = lowers(state.merit, coordinates);
  return state;
}

void Descent::take_for_best(State state) {
  state.coordinates = std::move(best_.coordinates);
  best_ = std::move(state);
  team_.run([&] { context_.guard.copy_coordinates(best_.coordinates); });
}

bool Descent::lowers(const Merit& merit, std::span<const double> coordinates) const {
  // To sample the mesh takes long, and no sample is below what is proved.
  if (!context_.least || merit.smallest >= std::min(threshold::kWanted, context_.least->min_scaled_jacobian))
    return false;
  return costs_shape(merit_of(scaled_jacobians(context_.mesh, coordinates, team_, context_.samples)),
                     merit_of(*context_.least));
}

Descent::State Descent::state_as_it_came() const {
  State state;
  state.coordinates = context_.mesh.coordinates;
  state.certificates.resize(context_.certifier.cells());
  team_.run([&] {
    context_.certifier.certify(state.coordinates, state.certificates, team_, sharers());
    judge(state.coordinates, state);
  });
  state.merit.loss = local_loss(context_.mesh, state.coordinates, team_, sharers());
  return state;
}

void Descent::judge(std::span<const double> coordinates, State& state) const {
  const Merit proved =
      merit_of(context_.certifier.sharpen(coordinates, state.certificates, threshold::kGapOfDescent, team_));
  state.merit.uncertified = proved.uncertified;
  state.merit.smallest = proved.smallest;
}

void Descent::gather_parts() {
  if (!part_) return;
  gather_positions(*part_, problem_.positions);
  gather_cells<CellScan>(*part_, barrier_.scans(), scans_);
}

std::vector<double> Descent::losses_around() const {
  const std::span<const double> own = form_.squared_losses();
  if (!part_) return loss_around(problem_, own, team_);
  std::vector<double> all(at(problem_.cells));
  gather_cells<double>(*part_, own, all);
  return loss_around(problem_, all, team_);
}

void Descent::set_weights() {
  const Material& m = context_.material;
  const double stiffness = has_bulk_constant(m) ? m.mu + (m.lambda + m.mu) / problem_.dimension : 1;
  objective_.form();
  const std::vector<double> around = losses_around();
  const auto barrier_share = [&](std::size_t cell) { return caution_ * kWeight * around[cell]; };
  std::vector<double> stiff(weights_.size()), hold(at(problem_.cells));
  team_.for_each(problem_.cells, kCellsPerTask, [&](std::int32_t cell) {
    const double size = problem_.cell_size[at(cell)];
    // What raises a cell must be able to move its vertices.
    hold[at(cell)] = kHold * barrier_share(at(cell)) / (size * size);
  });
  for (std::size_t s = 0; s < own_.sets.size(); ++s)
    team_.for_each(own_.sets[s].count, kCellsPerTask, [&](std::int32_t i) {
      const std::int32_t of_set = part_ ? part_->cells[s][at(i)] : i;
      const std::size_t cell = at(problem_.sets[s].first + of_set), own = at(own_.sets[s].first + i);
      const double weight = barrier_share(cell) * factors_[cell];
      weights_[own] = weight / cell_measure(own_.sets[s], i);
      stiff[own] = stiffness * weight;
    });
  levels_.take_diagonals(form_, stiff);
  objective_.hold_vertices(hold, from_);
}

void Descent::keep_certificates() {
  context_.guard.certify_moved();
  const std::vector<Standing> standings = context_.guard.standings();
  team_.without_stop().for_each(problem_.cells, kCellsPerTask, [&](std::int32_t cell) {
    lost_[cell] = standings[cell] == Standing::Lost ? 1 : 0;
    uncertified_[cell] = standings[cell] == Standing::Uncertified || standings[cell] == Standing::Unrepairable ? 1 : 0;
  });
  if (context_.guard.lost() > 0 && raises_lost_) {
    KeptRaiser raiser(context_.mesh, problem_, context_.guard, team_);
    if (raiser.raise_lost(asked_.bound, kLooksPerRound)) context_.guard.certify_moved();
  }
  if (context_.guard.lost() > 0) context_.guard.return_to_kept();
}

std::int64_t Descent::raise_low(double wanted, double margin, const std::vector<Certificate>& certificates) {
  std::int64_t low = 0;
  const std::span<const CellScan> scans = this->scans();
  for (const CellSet& set : problem_.sets)
    low += count_where(team_.without_stop(), static_cast<std::size_t>(set.count), kCellsPerTask, [&](std::size_t i) {
      const std::size_t cell = static_cast<std::size_t>(set.first) + i;
      const bool may_be_low = certificates[set.mesh_cell[i]].scaled_jacobian_lower_bound < wanted;
      const bool is_low = may_be_low && scans[cell].scaled_jacobian < wanted + margin;
      if (uncertified_[cell] != 0 || (lost_[cell] == 0 && !is_low)) return false;
      factors_[cell] *= kRaise;
      return true;
    });
  return low;
}

/// Sets what the scans of the last evaluation say.
void Descent::note_scans(DescentRound& round) const {
  const std::span<const CellScan> scans = this->scans();
  const Reduction reduction(team_);
  double measure = 0;
  for (const CellSet& set : problem_.sets)
    measure += reduction.sum(static_cast<std::size_t>(set.count), kCellsPerTask,
                             [&](std::size_t cell) { return cell_measure(set, static_cast<std::int32_t>(cell)); });
  round.energy =
      reduction.sum(scans.size(), kCellsPerTask, [&](std::size_t cell) { return scans[cell].energy; }) / measure;
  round.min_scaled_jacobian = -reduction.largest(
      scans.size(), kCellsPerTask, [&](std::size_t cell) { return -scans[cell].scaled_jacobian; }, -1);
}

void Descent::accept(const State& state) {
  accepted_.resize(problem_.positions.size());
  shared_copy<double>(problem_.positions, accepted_, team_);
  accepted_loss_ = state.merit.loss;
  accepted_js_ = state.merit.smallest;
  if (!is_better({.uncertified = best_.merit.uncertified}, {.uncertified = state.merit.uncertified}))
    asked_.highest_minimum = std::max(asked_.highest_minimum, state.merit.smallest);
}

/// Once, if the rounds would end below the bound and the last one has cost cells their certificate: goes on from here
/// with rounds that raise such cells, and the cells below the bound. Returns whether it does.
bool Descent::begin_to_raise_lost() {
  if (raises_lost_ || best_.merit.uncertified > 0 || reaches_bound(best_) || std::ranges::count(lost_, 1) == 0)
    return false;
  raises_lost_ = true;
  raises_ = kMostRaises / 2;
  caution_ = 1;
  std::ranges::fill(factors_, 1.0);
  const Team team = team_.without_stop();
  std::ranges::copy(solver_positions(context_.mesh, best_.coordinates, frame_of(context_.mesh, team), team),
                    problem_.positions.begin());
  accepted_loss_ = best_.merit.loss;
  accepted_js_ = best_.merit.smallest;
  team_.run([&] {
    shared_copy<double>(problem_.positions, accepted_, team_);
    context_.guard.certify_moved();
  });
  return true;
}

/// Goes back to the mesh at the beginning of the round.
void Descent::take_back() {
  caution_ *= kCaution;
  ++raises_;
  team_.run([&] {
    shared_copy<double>(accepted_, problem_.positions, team_);
    context_.guard.certify_moved();
  });
}

/// Each round is shorter than the one before by about the same factor, so what is left is the sum of a geometric
/// series.
bool Descent::comes_to_rest(double move) const {
  const double left = move < last_move_ / 2 ? move * move / (last_move_ - move) : move;
  return left <= kSettled;
}

/// Whether this is a mesh that a round has made from the best one with the same factors: nearer to where such rounds
/// lead, and as good.
bool Descent::refines(const Merit& merit) const {
  if (!best_settling_ || (merit.smallest >= asked_.bound) != reaches_bound(best_)) return false;
  Merit best = best_.merit;
  best.smallest = merit.smallest;
  best.loss *= threshold::kLossGivenForMinimum;
  return !is_better(best, merit, asked_);
}

/// Notes the highest minimum so far. Returns whether the bound would be reached within kMostRaisesInReach at the pace
/// of the last rounds.
bool Descent::comes_to_bound() {
  const double highest = asked_.highest_minimum;
  const double rise = (highest - earlier_minima_.front()) / static_cast<double>(earlier_minima_.size());
  std::ranges::rotate(earlier_minima_, earlier_minima_.begin() + 1);
  earlier_minima_.back() = highest;
  return highest + (kMostRaisesInReach - raises_) * rise >= asked_.bound;
}

/// Whether the curvature costs a solver anything beside the size of the cells. As the loss goes to 0, so does what
/// holds nodes, and rounds that went on would move them at random.
bool Descent::is_worth_more(const Merit& merit) const {
  return merit.loss > threshold::kNoLoss * std::pow(local_wave(context_.mesh), context_.mesh.order);
}

bool Descent::has_gained() const {
  return best_.merit.uncertified == 0 && best_.merit.loss < threshold::kFalls * start_loss_;
}

bool Descent::has_converged() const { return is_at_rest_ || (best_.merit.uncertified == 0 && !has_gained()); }

DescentRound Descent::round() {
  DescentRound round;
  team_.run([&] {
    if (part_) part_->follow();
    form_.take_frames();
    objective_.forget_form();
    set_weights();
    minimise(round);
    gather_parts();
    keep_certificates();
  });
  note_scans(round);
  State state = judged_kept_state();
  const Merit& merit = state.merit;
  const double smallest = merit.smallest;
  if (merit.loss > threshold::kRises * accepted_loss_ && merit.smallest <= accepted_js_ && raises_ < kMostRaises) {
    take_back();
    show_kept(round, accepted_js_);
    return round;
  }
  const bool rises = has_higher_minimum(merit, {.smallest = asked_.highest_minimum});
  accept(state);
  const bool reaches = is_acceptable(state);
  // The scans see the quadrature points only.
  const double margin = std::max(0.0, round.min_scaled_jacobian - merit.smallest);
  const double bound = std::max(
      asked_.bound, merit.lower_than_it_came ? std::min(threshold::kWanted, context_.least->min_scaled_jacobian) : 0);
  // Where the bound is reached, more weight for low cells waits until the rounds have come to an end with the present
  // weights. It is given once more only if it has raised the minimum.
  const bool rests = comes_to_rest(round.residual);
  const bool settled = rests || settling_ >= kMostSettling;
  const bool wants_more = reaches && settled;
  const std::int64_t low =
      raise_low(wants_more ? std::max(threshold::kWanted, bound) : bound, margin, state.certificates);
  const bool is_futile =
      settled && low > 0 && merit.smallest < settled_js_ + (reaches ? kWorthMore : threshold::kHigher);
  if (settled) settled_js_ = merit.smallest;
  raises_ += low > 0 ? 1 : 0;
  if (reaches) asked_.least_loss = std::min(asked_.least_loss, merit.loss);
  const bool has_come_to_end = settled || std::isfinite(settled_js_);
  const bool costs = reaches && has_come_to_end && merit.loss > threshold::kLossGivenForMinimum * asked_.least_loss;
  const bool falls = merit.loss < threshold::kFalls * last_loss_;
  const bool keeps_pace = comes_to_bound();
  const bool in_reach = !reaches && merit.smallest >= threshold::kInReach * asked_.bound && (falls || keeps_pace);
  // If no mesh so far reaches the bound or comes near it, more weight for low cells is worth it only as long as
  // something gains. A mesh that keeps invalid cells is such a mesh.
  const bool gains = falls || rises || reaches || in_reach || reaches_bound(best_);
  settling_ = low == 0 ? settling_ + 1 : 0;
  last_move_ = low == 0 ? round.residual : 0;
  is_at_rest_ = (low == 0 && rests) || (reaches && !is_worth_more(merit));
  round.last = is_at_rest_ || (low == 0 && settled) || is_futile || !gains ||
               raises_ > (in_reach ? kMostRaisesInReach : kMostRaises) || costs;
  last_loss_ = std::min(last_loss_, merit.loss);
  if (refines(merit) || is_better(merit, best_.merit, asked_)) {
    take_for_best(std::move(state));
    best_settling_ = true;
  }
  if (low > 0) best_settling_ = false;
  if (round.last && begin_to_raise_lost()) round.last = false;
  show_kept(round, smallest);
  return round;
}

}  // namespace varimesh
