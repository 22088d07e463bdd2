#include "core/solvers/descent/descent.h"

#include <algorithm>
#include <cmath>

#include "core/kernels/p_norm.h"
#include "core/merit/thresholds.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/quality/certified_quality.h"
#include "core/solvers/descent/has_loss.h"
#include "core/solvers/maxmin/kept_raiser.h"

namespace varimesh {
namespace {

/// ε_e is the squared loss times this. Ten times as much costs 3 % of the loss on the first meshes of docs/accuracy.md;
/// a third leaves the scaled Jacobian of some elements .05 lower.
constexpr double kWeight = 3;
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
/// L-BFGS ends when a whole step would lower the sum by about this share of it.
constexpr double kLittle = 1e-3;
constexpr int kMostSteps = 40;
constexpr int kMostTrials = 12;
constexpr double kNoise = 1e-13;  // of the sum
constexpr std::size_t kNodesPerTask = 4096;
constexpr std::size_t kCellsPerSum = 512;

}  // namespace

Descent::Descent(const DescentContext& context)
    : context_(context),
      problem_(context.problem),
      team_(context.team),
      from_(free_positions(problem_, problem_.positions)),
      space_(own_space(problem_)),
      form_(problem_, space_, team_),
      barrier_(problem_, context.kernels, context.hessian, PNorm{}, team_),
      levels_(problem_, context.mesh, space_, team_),
      quasi_newton_(problem_.free.size() * problem_.dimension, team_),
      factors_(problem_.cells, 1.0),
      weights_(problem_.cells),
      start_(problem_.free.size() * problem_.dimension),
      work_(start_.size()),
      lost_(problem_.cells, 0),
      uncertified_(problem_.cells, 0),
      asked_(context.asked) {
  barrier_.weigh(weights_, form_.volume());
  barrier_.count_with(context.meter, point_operations(context.material, problem_.dimension));
  const std::vector<Standing> standings = context.guard.standings();
  for (CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell)
      if (standings[set.first + cell] == Standing::Valid) set.delta_squared[cell] = 0;
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
         !(as_it_came && reaches_bound(best_) && !has_loss(context_.mesh, best_.merit.smallest, team_));
}

void Descent::start_from(State state) {
  best_ = std::move(state);
  start_loss_ = best_.merit.loss;
  if (context_.came_valid) asked_.loss_as_it_came = start_loss_;
}

bool Descent::stays_invalid_for_size() const {
  return best_.merit.uncertified > 0 && size_decides(context_.mesh, best_.merit.loss, team_);
}

Descent::State Descent::kept_state() const {
  State state;
  team_.run([&] {
    state.coordinates = context_.guard.coordinates();
    state.certificates = context_.guard.certificates();
    judge(state);
  });
  state.merit.loss = accuracy(context_.mesh, state.coordinates, team_).loss;
  state.merit.lower_than_it_came = lowers(state);
  return state;
}

bool Descent::lowers(const State& state) const {
  // To sample the mesh takes long, and no sample is below what is proved.
  if (!context_.least || state.merit.smallest >= context_.least->min_scaled_jacobian) return false;
  return is_lower(merit_of(scaled_jacobians(context_.mesh, state.coordinates, team_)), merit_of(*context_.least),
                  threshold::kHigher);
}

Descent::State Descent::state_as_it_came() const {
  State state;
  state.coordinates = context_.mesh.coordinates;
  state.certificates.resize(context_.certifier.cells());
  team_.run([&] {
    context_.certifier.certify(state.coordinates, state.certificates, team_);
    judge(state);
  });
  state.merit.loss = accuracy(context_.mesh, team_).loss;
  return state;
}

void Descent::judge(State& state) const {
  const Merit proved = merit_of(
      context_.certifier.sharpen(state.coordinates, state.certificates, threshold::kGapOfDescent, team_.stop()));
  state.merit.uncertified = proved.uncertified;
  state.merit.smallest = proved.smallest;
}

void Descent::set_weights(double loss) {
  const Material& m = context_.material;
  const double stiffness = has_bulk_constant(m) ? m.mu + (m.lambda + m.mu) / problem_.dimension : 1;
  for (std::size_t cell = 0; cell < weights_.size(); ++cell)
    weights_[cell] = caution_ * kWeight * loss * loss * factors_[cell];
  std::vector<double> stiff(weights_);
  for (double& one : stiff) one *= stiffness;
  levels_.take_diagonals(form_, stiff);
}

double Descent::evaluate(std::span<double> gradient) {
  barrier_.gradient(gradient);
  const double energy = barrier_.value();
  if (!std::isfinite(energy)) return energy;
  const double loss = form_.gradient(work_);
  team_.for_ranges(gradient.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) gradient[i] += work_[i];
  });
  return energy + loss;
}

void Descent::move(double alpha, std::span<const double> step) {
  const std::size_t d = problem_.dimension;
  team_.for_ranges(problem_.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      for (std::size_t k = 0; k < d; ++k)
        problem_.positions[problem_.free[f] * d + k] = start_[f * d + k] + alpha * step[f * d + k];
  });
}

double Descent::largest(std::span<const double> step) const {
  const std::size_t d = problem_.dimension;
  double largest = 0;
  for (std::size_t f = 0; f < problem_.free.size(); ++f) {
    double square = 0;
    for (std::size_t k = 0; k < d; ++k) square += step[f * d + k] * step[f * d + k];
    largest = std::max(largest, std::sqrt(square) * problem_.inverse_size[f]);
  }
  return largest;
}

void Descent::minimise(DescentRound& round) {
  const QuasiNewtonOutcome outcome = quasi_newton_.minimise(*this, {kMostSteps, kMostTrials, kLittle, kNoise});
  if (first_gradient_ == 0) first_gradient_ = outcome.first_gradient;
  round.steps = outcome.steps;
  round.residual = outcome.residual;
  round.relative_gradient = first_gradient_ > 0 ? outcome.last_gradient / first_gradient_ : 0;
}

void Descent::keep_certificates() {
  context_.guard.certify_moved();
  const std::vector<Standing> standings = context_.guard.standings();
  for (std::size_t cell = 0; cell < lost_.size(); ++cell) {
    lost_[cell] = standings[cell] == Standing::Lost ? 1 : 0;
    uncertified_[cell] = standings[cell] == Standing::Uncertified || standings[cell] == Standing::Unrepairable ? 1 : 0;
  }
  if (context_.guard.lost() > 0 && raises_lost_) {
    KeptRaiser raiser(context_.mesh, problem_, context_.guard, team_);
    if (raiser.raise_lost(asked_.bound, kLooksPerRound)) context_.guard.certify_moved();
  }
  if (context_.guard.lost() > 0) context_.guard.return_to_kept();
}

std::int64_t Descent::raise_low(double wanted) {
  std::int64_t low = 0;
  const std::span<const CellScan> scans = barrier_.scans();
  for (std::size_t cell = 0; cell < factors_.size(); ++cell) {
    if (uncertified_[cell] != 0 || (lost_[cell] == 0 && scans[cell].scaled_jacobian >= wanted)) continue;
    factors_[cell] *= kRaise;
    ++low;
  }
  return low;
}

/// Sets what the scans of the last evaluation say.
void Descent::note_scans(DescentRound& round) const {
  const std::span<const CellScan> scans = barrier_.scans();
  double energy = 0, measure = 0;
  round.min_scaled_jacobian = 1;
  for (const CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      energy += scans[set.first + cell].energy;
      measure += cell_measure(set, cell);
      round.min_scaled_jacobian = std::min(round.min_scaled_jacobian, scans[set.first + cell].scaled_jacobian);
    }
  round.energy = energy / measure;
}

void Descent::accept(const State& state) {
  accepted_ = problem_.positions;
  accepted_loss_ = state.merit.loss;
  accepted_js_ = state.merit.smallest;
  if (!is_better({.uncertified = best_.merit.uncertified}, {.uncertified = state.merit.uncertified}))
    asked_.highest_minimum = std::max(asked_.highest_minimum, state.merit.smallest);
}

template <class Archive>
void Descent::state(Archive& archive) {
  std::vector<double> accepted;
  if constexpr (!Archive::kReads) accepted = free_positions(problem_, accepted_);
  archive(factors_, first_gradient_, start_loss_, last_loss_, asked_.least_loss, raises_, caution_, raises_lost_,
          accepted, accepted_loss_, accepted_js_, asked_.highest_minimum, best_.coordinates, best_.merit.uncertified,
          best_.merit.smallest, best_.merit.loss);
  if constexpr (Archive::kReads)
    if (archive.failed() || !restore(accepted)) archive.fail();
}

void Descent::write(CheckpointWriter& writer) {
  writer(from_);
  for (const CellSet& set : problem_.sets)
    writer(std::vector<double>(set.delta_squared.begin(), set.delta_squared.end()));
  state(writer);
}

void Descent::read(std::optional<Descent>& descent, const DescentContext& context, CheckpointReader& reader) {
  Problem& problem = context.problem;
  const std::vector<double> positions = problem.positions;
  std::vector<double> from;
  reader(from);
  // The constructor measures the mesh where the descent began.
  if (reader.failed() || !set_free_positions(problem, from, problem.positions)) return reader.fail();
  descent.emplace(context);
  problem.positions = positions;
  for (CellSet& set : problem.sets) {
    std::vector<double> delta_squared;
    reader(delta_squared);
    if (reader.failed() || delta_squared.size() != set.delta_squared.size()) return reader.fail();
    std::ranges::copy(delta_squared, set.delta_squared.begin());
  }
  descent->state(reader);
}

bool Descent::restore(const std::vector<double>& accepted) {
  accepted_ = problem_.positions;
  if (!set_free_positions(problem_, accepted, accepted_) || factors_.size() != weights_.size() ||
      best_.coordinates.size() != context_.mesh.coordinates.size())
    return false;
  if (context_.came_valid) asked_.loss_as_it_came = start_loss_;
  State best = best_;
  best.certificates.resize(context_.certifier.cells());
  context_.certifier.certify(best.coordinates, best.certificates, team_);
  judge(best);
  best_.certificates = std::move(best.certificates);
  return true;
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
  return true;
}

/// Goes back to the mesh at the beginning of the round.
void Descent::take_back() {
  caution_ *= kCaution;
  ++raises_;
  team_.run([&] {
    problem_.positions = accepted_;
    context_.guard.certify_moved();
  });
}

DescentRound Descent::round() {
  DescentRound round;
  team_.run([&] {
    form_.take_frames();
    set_weights(last_loss_);
    minimise(round);
    keep_certificates();
  });
  note_scans(round);
  State state = kept_state();
  const Merit& merit = state.merit;
  if (merit.loss > threshold::kRises * accepted_loss_ && merit.smallest <= accepted_js_ && raises_ < kMostRaises) {
    take_back();
    return round;
  }
  const bool rises = has_higher_minimum(merit, {.smallest = asked_.highest_minimum});
  accept(state);
  const bool reaches = is_acceptable(state);
  // The scans see the quadrature points only.
  const double margin = std::max(0.0, round.min_scaled_jacobian - merit.smallest);
  const double bound = std::max(asked_.bound, merit.lower_than_it_came ? context_.least->min_scaled_jacobian : 0);
  const std::int64_t low = raise_low((reaches ? std::max(threshold::kWanted, bound) : bound) + margin);
  raises_ += low > 0 ? 1 : 0;
  if (reaches) asked_.least_loss = std::min(asked_.least_loss, merit.loss);
  const bool costs = reaches && merit.loss > threshold::kLossGivenForMinimum * asked_.least_loss;
  const bool in_reach = !reaches && merit.smallest >= threshold::kInReach * asked_.bound;
  const bool falls = merit.loss < threshold::kFalls * last_loss_;
  // If all cells are certified, but far below the bound in every mesh so far, more weight for low cells is worth it
  // only as long as something gains.
  const bool gains = falls || rises || reaches || in_reach || reaches_bound(best_) || best_.merit.uncertified > 0;
  round.last = (low == 0 && !falls) || !gains || raises_ > (in_reach ? kMostRaisesInReach : kMostRaises) || costs;
  last_loss_ = std::min(last_loss_, merit.loss);
  if (is_better(state.merit, best_.merit, asked_)) best_ = std::move(state);
  if (round.last && begin_to_raise_lost()) round.last = false;
  return round;
}

}  // namespace varimesh
