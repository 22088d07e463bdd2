#include "core/slide/coupled/coupled.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/base/index.h"
#include "core/base/shared_work.h"
#include "core/base/stopwatch.h"
#include "core/kernels/regularisation.h"
#include "core/merit/merit.h"
#include "core/merit/thresholds.h"
#include "core/mesh/connectivity.h"
#include "core/quality/certified_quality.h"
#include "core/slide/coupled/coupled_newton.h"
#include "core/slide/coupled/hold_back.h"
#include "core/slide/periodic_pairs.h"
#include "core/slide/slide.h"
#include "core/validity/certifier.h"
#include "core/validity/orientation.h"

namespace varimesh::detail {
namespace {

constexpr std::size_t kCellsPerTask = 4096;
constexpr int kMostStepsInside = 20, kMostSteps = 40;
constexpr int kMostWithoutGain = 12;  // steps, before a descent ends
/// The energy stands if it falls by less than this, relative to itself.
constexpr double kStands = 1e-4;
/// The weights of the boundary's energy, one after the other while its distance from the geometry exceeds the limit.
constexpr double kWeights[] = {1, 4};
/// How much of the way to a state that exceeds the limit all nodes go, if it is tried.
constexpr double kParts[] = {0.875, 0.75, 0.625, 0.5, 0.375, 0.25, 0.125, 0.0625, 0.03125, 0.015625};
constexpr double kTimesStart = 2;    // what the distances may become without a tolerance
constexpr double kRounding = 1e-12;  // distances that differ by less, relative to the mesh's size, are equal

using Distance = BoundaryEnergy::Distance;

/// A state and how good it is.
struct Judged {
  CoupledState state;
  Merit merit;  ///< With the weak cells and the proved minimum.
  std::int64_t folded = 0;
  Distance distance;  ///< Only of a state that may be the best one: to find it takes longer than all else here.
};

/// The entities' elements, and the energies on them, for one mesh.
struct Energies {
  std::vector<std::vector<EntityElement>> curves, surfaces;
  BoundaryEnergy boundary;
  OrientedMesh oriented;
  VolumeEnergy volume;

  Energies(const HighOrderMesh& mesh, const Association& association, const std::vector<double>& as_it_came,
           const std::vector<bool>& fixed, const Team& team)
      : curves(curve_elements(mesh, association)),
        surfaces(surface_elements(mesh, association)),
        boundary({association, curves, surfaces, mesh.order, as_it_came, mesh.coordinates, fixed}, team),
        oriented(mesh, team),
        volume(oriented.mesh(), staying(mesh, fixed), team) {
    boundary.prepare(mesh, volume.volumes(), volume.nodes(), volume.diagonal());
  }

 private:
  std::vector<bool> staying(const HighOrderMesh& mesh, const std::vector<bool>& fixed) const {
    std::vector<bool> stays = fixed_nodes(mesh);
    for (std::size_t node = 0; node < stays.size(); ++node)
      stays[node] = fixed[node] || (stays[node] && !boundary.slides(static_cast<std::int32_t>(node)));
    return stays;
  }
};

/// The steps of Newton's method and what is kept of them.
class Descent {
 public:
  /// @param seconds  no step begins later than this after now; 0: no limit
  Descent(Energies& energies, const HighOrderMesh& mesh, double seconds, const Team& team)
      : energies_(energies),
        certifier_(energies.oriented.mesh(), {}, team),
        exact_(energies.oriented.mesh(), exactly(), team),
        newton_(energies.volume, energies.boundary, mesh.coordinates, team),
        team_(team),
        certificates_(certifier_.cells()),
        as_it_slid_(newton_.state()),
        seconds_(seconds) {}

  /// Puts the nodes back to where they were. From now on δ falls at this rate.
  void begin_again(double decay) {
    newton_.restore(as_it_slid_);
    decay_ = decay;
  }

  /// Only nodes inside the mesh move. Returns the best state.
  Judged inside() {
    newton_.boundary_slides = false;
    Judged best = judge();
    descend(kMostStepsInside, [&] {
      Judged now = judge();
      if (!is_better(now.merit, best.merit, kAskForMinimum)) return false;
      best = std::move(now);
      return true;
    });
    best.distance = distance();  // the same in all these states
    return best;
  }

  /// All nodes move. If the limits do not allow where they come to, all go a part of the way, or those of the boundary
  /// are held back (hold_back.h). Returns the best state that the limits allow, if there is one.
  /// @param start  what inside() has returned
  std::optional<Judged> everything(const Judged& start, const DistanceLimit& surfaces, const DistanceLimit& curves) {
    std::optional<Judged> best;
    const auto allow = [&](const Distance& now) { return surfaces.allows(now.surfaces) && curves.allows(now.curves); };
    const auto gains = [&] {
      Judged now = judge();
      if (now.folded > start.folded || (best && !is_better(now.merit, best->merit, kAskForMinimum))) return false;
      now.distance = distance();
      if (!allow(now.distance)) return false;
      best = std::move(now);
      return true;
    };
    newton_.boundary_slides = true;
    newton_.restore(start.state);
    for (const double weight : kWeights) {
      newton_.boundary_weight = weight;
      descend(kMostSteps, gains);
      if (best && allow(distance())) break;
      const CoupledState end = newton_.state();
      for (const double part : kParts) {
        if (is_late()) break;
        newton_.put_between(start.state, end, std::vector<double>(end.coordinates.size() / 3, part));
        gains();
      }
      if ((!best || best->merit.weak > 0) &&
          hold_back(start.state, end, surfaces, curves, newton_, energies_.boundary)) {
        gains();
        newton_.boundary_slides = false;
        descend(kMostStepsInside, gains);
        newton_.boundary_slides = true;
      }
      if (is_late()) break;
      newton_.restore(end);
    }
    return best;
  }

  int steps() const { return steps_; }
  bool is_late() const { return seconds_ > 0 && watch_.seconds() > seconds_; }
  /// Leaves the energies in this state.
  void take(const CoupledState& state) { newton_.restore(state); }

 private:
  /// @param gains  bool(): whether the state after a step is better than all before
  template <class Gains>
  void descend(int most_steps, const Gains& gains) {
    int without = 0;
    for (int step = 0; step < most_steps && !is_late(); ++step) {
      const double delta = newton_.least() > 0 ? 0 : falling_delta(step, decay_);
      const NewtonOutcome outcome = newton_.step(delta);
      ++steps_;
      if (outcome.damping == 0) return;
      without = gains() ? 0 : without + 1;
      if (without == kMostWithoutGain ||
          (delta == 0 && outcome.before - outcome.after < kStands * std::abs(outcome.before)))
        return;
    }
  }

  Judged judge() {
    certifier_.certify(newton_.coordinates(), certificates_, team_);
    const std::vector<std::int32_t> unsure =
        indices_where(team_, certificates_.size(), kCellsPerTask,
                      [&](std::size_t cell) { return certificates_[cell].is_valid() && is_weak(certificates_[cell]); });
    exact_.certify(newton_.coordinates(), unsure, certificates_, team_);
    Merit merit = merit_of(certifier_.sharpen(newton_.coordinates(), certificates_, threshold::kGapOfStates, team_));
    merit.weak = count_where(team_, certificates_.size(), kCellsPerTask,
                             [&](std::size_t cell) { return is_weak(certificates_[cell]); });
    return {newton_.state(), merit, energies_.boundary.folded(), {}};
  }

  Distance distance() const { return energies_.boundary.distance(newton_.coordinates()); }

  static bool is_weak(const Certificate& certificate) {
    return !certificate.is_valid() || certificate.scaled_jacobian_lower_bound < threshold::kWeak;
  }
  static CertificateOptions exactly() {
    CertificateOptions options;
    options.gap = threshold::kGapOfWeak;
    return options;
  }
  Energies& energies_;
  Certifier certifier_, exact_;
  CoupledNewton newton_;
  const Team& team_;
  std::vector<Certificate> certificates_;
  CoupledState as_it_slid_;
  double decay_ = kDeltaFalls;
  double seconds_;
  Stopwatch watch_;
  int steps_ = 0;
};

/// The distances of the mesh as it came, by the association that it had then.
Distance distance_of(const HighOrderMesh& mesh, const Association& association, const std::vector<bool>& fixed,
                     const Team& team) {
  const auto curves = curve_elements(mesh, association), surfaces = surface_elements(mesh, association);
  return BoundaryEnergy({association, curves, surfaces, mesh.order, mesh.coordinates, mesh.coordinates, fixed}, team)
      .distance(mesh.coordinates);
}

DistanceLimit limit_of(double tolerance, const Distances& start, const Distances& slid, double rounding) {
  if (tolerance > 0) return {std::max(tolerance, slid.largest) + rounding, std::max(tolerance, slid.rms()) + rounding};
  return {kTimesStart * start.largest + rounding, kTimesStart * start.rms() + rounding};
}

/// Without a tolerance, edges on curves may lie as far from them as elements from their surfaces, if these may lie
/// farther.
DistanceLimit larger(const DistanceLimit& a, const DistanceLimit& b) {
  return {std::max(a.largest, b.largest), std::max(a.rms, b.rms)};
}

/// Whether the nodes go back to where bottom-up sliding has left them.
bool goes_back(const HighOrderMesh& mesh, const Judged& all, const Judged& inside, const Team& team) {
  const auto without_weak = [](Merit merit) {
    merit.weak.reset();
    return merit;
  };
  if (is_better(inside.merit, all.merit) || is_better(without_weak(inside.merit), without_weak(all.merit))) return true;
  if (is_better(all.merit, inside.merit)) return all.merit.weak == inside.merit.weak && all.merit.uncertified > 0;
  return is_lower(merit_of(scaled_jacobians(mesh, all.state.coordinates, team)),
                  merit_of(scaled_jacobians(mesh, inside.state.coordinates, team)));
}

void count_moved(const std::vector<double>& start, const HighOrderMesh& mesh, const Association& association,
                 SlideReport& report) {
  report.nodes = 0;
  report.farthest = 0;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    if (association.nodes[node].dimension < 1) continue;
    const double by = (Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * node]) -
                       Eigen::Map<const Eigen::Vector3d>(&start[3 * node]))
                          .norm();
    report.nodes += by > 0 ? 1 : 0;
    report.farthest = std::max(report.farthest, by);
  }
}

}  // namespace

std::string CoupledReport::sentence() const {
  const auto elements = [](std::int64_t count) {
    return count == 1 ? std::string("1 element is") : std::to_string(count) + " elements are";
  };
  const std::string moved = "moved together for " + std::to_string(steps) + (steps == 1 ? " step" : " steps");
  if (outcome == Outcome::NoTime)
    return "The time was over while all nodes moved together, so the boundary stays where sliding left it.";
  if (outcome == Outcome::TooFar)
    return "All nodes " + moved +
           ", but no mesh on the way was within the limits of distance, so the boundary stays where sliding left it.";
  if (outcome == Outcome::NoBetter)
    return "All nodes " + moved + ", but that made the mesh no better, so the boundary stays where sliding left it.";
  return "Then all nodes " + moved + ". Before the optimisation, " + elements(left_after) +
         " not certified valid in this mesh, and " + std::to_string(left_before) +
         " with the boundary where sliding left it.";
}

namespace {

/// What slide_coupled() does after the nodes have slid bottom-up. Changes the mesh and what belongs to it at its end.
/// @param start    the distances of the mesh as it came
/// @param seconds  no step begins later; 0: no limit
/// @param report   of bottom-up sliding; that of all
void move_all_together(HighOrderMesh& mesh, Association& association, const std::vector<double>& as_it_came,
                       const Distance& start, const std::vector<bool>& fixed, double tolerance, double seconds,
                       const Team& team, SlideReport& report, CoupledReport& coupled) {
  std::optional<Energies> energies;
  std::optional<Descent> descent;
  std::optional<Judged> inside, all;
  team.run([&] {
    // Two sides of a period would be moved by different cells.
    std::vector<bool> stays = fixed;
    PeriodicPairs(mesh, association.size).fix_all(stays);
    energies.emplace(mesh, association, as_it_came, stays, team);
    descent.emplace(*energies, mesh, seconds, team);
    inside = descent->inside();
    const double rounding = kRounding * association.size;
    const DistanceLimit surfaces = limit_of(tolerance, start.surfaces, inside->distance.surfaces, rounding);
    const DistanceLimit curves = limit_of(tolerance, start.curves, inside->distance.curves, rounding);
    const DistanceLimit on_curves = tolerance > 0 ? curves : larger(surfaces, curves);
    all = descent->everything(*inside, surfaces, on_curves);
    if ((all && all->merit.weak == 0) || descent->is_late()) return;
    descent->begin_again(kDeltaFallsFast);
    Judged again = descent->inside();
    std::optional<Judged> all_again = descent->everything(again, surfaces, on_curves);
    if (is_better(again.merit, inside->merit, kAskForMinimum)) inside = std::move(again);
    if (all_again && (!all || is_better(all_again->merit, all->merit, kAskForMinimum))) all = std::move(all_again);
  });
  using Outcome = CoupledReport::Outcome;
  coupled = {all ? Outcome::NoBetter : Outcome::TooFar, descent->steps(), inside->merit.uncertified,
             inside->merit.uncertified};
  if (!all || goes_back(mesh, *all, *inside, team)) return;
  team.run([&] { descent->take(all->state); });
  coupled.outcome = Outcome::Taken;
  coupled.left_after = all->merit.uncertified;
  mesh.coordinates = all->state.coordinates;
  energies->boundary.write(association);
  report.folded_after = all->folded;
  report.after = {all->distance.surfaces.largest, all->distance.surfaces.rms()};
  count_moved(as_it_came, mesh, association, report);
}

}  // namespace

SlideReport slide_coupled(HighOrderMesh& mesh, Association& association, const std::vector<bool>& fixed,
                          const CoupledLimits& limits, const Team& team, CoupledReport& coupled) {
  constexpr double kNoTime = 1e-9;  // 0 would mean no limit
  const Stopwatch watch;
  const std::vector<double> as_it_came = mesh.coordinates;
  SlideReport report;
  Distance start;
  team.run([&] {
    start = distance_of(mesh, association, fixed, team);
    report = slide(mesh, association, SlideOn::All, fixed, team);
  });
  const double seconds = limits.seconds > 0 ? std::max(kNoTime, limits.seconds - watch.seconds()) : 0;
  try {
    move_all_together(mesh, association, as_it_came, start, fixed, limits.tolerance, seconds, team, report, coupled);
  } catch (const Interrupted&) {
    if (team.stop()->reason() == StopToken::Reason::Asked) throw;
    coupled.outcome = CoupledReport::Outcome::NoTime;
  }
  return report;
}

}  // namespace varimesh::detail
