#include "core/solvers/sweeps/sweep.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/reduction.h"
#include "core/base/shared_work.h"
#include "core/kernels/node_star.h"
#include "core/kernels/regularisation.h"
#include "core/solvers/line_search.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNodesPerTask = 64;
constexpr std::int32_t kCellsPerTask = 64;
constexpr std::size_t kTermsPerTask = 4096;  // of a sum
constexpr std::size_t kNumbersPerTask = 16384;
constexpr int kMostTrials = 40;         // of a line search
constexpr double kEnergyNoise = 1e-14;  // relative to the star's measure: a smaller change of the energy is rounding

/// −H⁻¹ G by the cofactors of H. This takes one division; a factorisation would wait for d of them. False if H is not
/// positive definite, or if the pivots of its factorisation L D Lᵀ (quotients of successive minors) are far apart.
template <int d>
bool direct_step(const Eigen::Matrix<double, d, d>& H, const Eigen::Matrix<double, d, 1>& G,
                 Eigen::Matrix<double, d, 1>& step) {
  constexpr double kSpread = 0.0025;
  const double first = H(0, 0), second = H(0, 0) * H(1, 1) - H(1, 0) * H(1, 0);
  if constexpr (d == 2) {
    // Pivots first and second/first.
    const double square = first * first;
    if (!(first > 0 && second > kSpread * square && square > kSpread * second)) return false;
    const double inverse = -1 / second;
    step[0] = inverse * (H(1, 1) * G[0] - H(1, 0) * G[1]);
    step[1] = inverse * (H(0, 0) * G[1] - H(1, 0) * G[0]);
  } else {
    double C[3][3];
    C[0][0] = H(1, 1) * H(2, 2) - H(2, 1) * H(2, 1);
    C[1][0] = H(2, 1) * H(2, 0) - H(1, 0) * H(2, 2);
    C[2][0] = H(1, 0) * H(2, 1) - H(1, 1) * H(2, 0);
    C[1][1] = H(0, 0) * H(2, 2) - H(2, 0) * H(2, 0);
    C[2][1] = H(1, 0) * H(2, 0) - H(0, 0) * H(2, 1);
    C[2][2] = second;
    const double third = H(0, 0) * C[0][0] + H(1, 0) * C[1][0] + H(2, 0) * C[2][0];
    // The pivots are first, second/first and third/second. They are compared after multiplication by first · second.
    const double a = first * first * second, b = second * second, c = third * first;
    const double least = std::min(a, std::min(b, c)), most = std::max(a, std::max(b, c));
    if (!(first > 0 && second > 0 && third > 0 && least > kSpread * most)) return false;
    const double inverse = -1 / third;
    step[0] = inverse * (C[0][0] * G[0] + C[1][0] * G[1] + C[2][0] * G[2]);
    step[1] = inverse * (C[1][0] * G[0] + C[1][1] * G[1] + C[2][1] * G[2]);
    step[2] = inverse * (C[2][0] * G[0] + C[2][1] * G[1] + C[2][2] * G[2]);
  }
  return true;
}

template <int d>
std::array<double, 3> newton_step_of(const StarExpansion& expansion) {
  Eigen::Matrix<double, d, d> H;
  Eigen::Matrix<double, d, 1> G;
  for (int i = 0, entry = 0; i < d; ++i) {
    G[i] = expansion.gradient[i];
    for (int j = 0; j <= i; ++j, ++entry) H(i, j) = H(j, i) = expansion.hessian[entry];
  }
  Eigen::Matrix<double, d, 1> step;
  if (!direct_step<d>(H, G, step)) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, d, d>> eigen(H);
    const Eigen::Matrix<double, d, 1> size = eigen.eigenvalues().cwiseAbs();
    const Eigen::Matrix<double, d, 1> clamped = size.cwiseMax(1e-3 * size.maxCoeff());
    step = -(eigen.eigenvectors() * (eigen.eigenvectors().transpose() * G).cwiseQuotient(clamped));
  }
  std::array<double, 3> out{};
  for (int i = 0; i < d; ++i) out[i] = std::isfinite(step[i]) ? step[i] : 0.0;
  return out;
}

}  // namespace

std::array<double, 3> newton_step(const StarExpansion& expansion, int dimension) {
  return dimension == 2 ? newton_step_of<2>(expansion) : newton_step_of<3>(expansion);
}

// === Scans and δ =========================================================================================

Sweeper::Sweeper(Problem& problem, const ColouredNodes& coloured, const Kernels& kernels, Regularisation regularisation,
                 const PNorm& norm, double rest, const Team& team)
    : problem_(problem),
      coloured_(coloured),
      kernels_(kernels),
      line_size_(kernels.line_size()),
      regularisation_(regularisation),
      norm_(norm),
      team_(team),
      scans_(problem.cells),
      changed_(problem.cells, 1),
      drifted_(problem.cells, 1),
      rest_(rest),
      moved_at_(problem.cells, 0),
      moves_(problem.cells, 0.0) {
  grain_ = std::max<std::int32_t>(1, static_cast<std::int32_t>(kNodesPerTask * coloured.group_count() /
                                                               std::max<std::size_t>(1, problem.free.size())));
  for (const CellSet& set : problem.sets)
    measure_ += Reduction(team).sum(static_cast<std::size_t>(set.count), kTermsPerTask, [&](std::size_t cell) {
      return cell_measure(set, static_cast<std::int32_t>(cell));
    });
  for (std::size_t group = 0; group + 1 < coloured.groups.size(); ++group)
    largest_group_ = std::max<std::int64_t>(largest_group_, coloured.groups[group + 1] - coloured.groups[group]);
}

void Sweeper::rebuild() {
  if (hold_deformation(problem_, kernels_.keeps_function())) std::fill(drifted_.begin(), drifted_.end(), 1);
  const Stopwatch watch;
  double operations = 0;
  for (CellSet& set : problem_.sets) {
    operations += static_cast<double>(marked(set, drifted_)) * rebuild_operations(set, point_);
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
      if (drifted_[set.first + cell] == 0) return;
      kernels_.rebuild(set, cell, problem_.positions);
      drifted_[set.first + cell] = 0;
      changed_[set.first + cell] = 1;
    });
  }
  count_kernels(operations, watch);
}

std::int64_t Sweeper::marked(const CellSet& set, const std::vector<char>& marks) {
  const auto first = marks.begin() + set.first;
  return set.count - std::count(first, first + set.count, 0);
}

void Sweeper::count_kernels(double operations, const Stopwatch& watch) const {
  if (meter_ != nullptr) meter_->add_kernels({operations, watch.seconds() * team_.threads()});
}

bool Sweeper::refresh() {
  if ((!visited_at_.empty() && visited_at_.size() != problem_.free.size()) || moved_at_.size() != scans_.size() ||
      moves_.size() != scans_.size())
    return false;
  drop_deformation(problem_);
  for (CellSet& set : problem_.sets)
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
      set.delta_squared[cell] = delta_squared_of(set, cell, scan_of(set, cell).smallest_jacobian);
      scans_[set.first + cell] = scan_of(set, cell);
    });
  std::fill(changed_.begin(), changed_.end(), 0);
  return true;
}

void Sweeper::changed() {
  std::fill(changed_.begin(), changed_.end(), 1);
  wake();
}

void Sweeper::changed(std::span<const CellScan> scans) {
  shared_copy<CellScan>(scans, scans_, team_);
  for (CellSet& set : problem_.sets)
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) { update_delta(set, cell); });
  std::fill(changed_.begin(), changed_.end(), 0);
  wake();
}

void Sweeper::wake() {
  team_.without_stop().for_ranges(visited_at_.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    std::fill_n(visited_at_.data() + begin, end - begin, 0);
  });
}

CellScan Sweeper::scan_of(const CellSet& set, std::int32_t cell) const {
  if (!set.deformation.empty()) return kernels_.scan_kept(set, cell);
  static thread_local AlignedVector<double> deformation;
  deformation.resize(set.deformation_size());
  kernels_.deform(set, cell, problem_.positions, deformation.data());
  return kernels_.scan(set, cell, deformation.data(), nullptr);
}

void Sweeper::rescan(CellSet& set, std::int32_t cell) {
  scans_[set.first + cell] = scan_of(set, cell);
  changed_[set.first + cell] = 0;
  update_delta(set, cell);
}

void Sweeper::update_delta(CellSet& set, std::int32_t cell) {
  CellScan& scan = scans_[set.first + cell];
  const double delta_squared = delta_squared_of(set, cell, scan.smallest_jacobian);
  if (delta_squared == set.delta_squared[cell]) return;
  set.delta_squared[cell] = delta_squared;
  scan = scan_of(set, cell);
  moved_at_[set.first + cell] = clock_;  // the energy of the cell is another function now: wakes its nodes
}

ScanOutcome Sweeper::scan() {
  ScanOutcome outcome;
  const Reduction reduction(team_);
  ++clock_;  // later than every visit so far, so that a cell with a new δ wakes its nodes
  const Stopwatch watch;
  double operations = 0;
  for (CellSet& set : problem_.sets) {
    operations += static_cast<double>(marked(set, changed_)) *
                  (set.deformation.empty() ? scan_operations(set, point_) : kept_scan_operations(set, point_));
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
      const bool was_unrepairable = set.delta_squared[cell] == kUnrepairableDeltaSquared;
      if (changed_[set.first + cell] != 0 || is_unrepairable(set, cell) != was_unrepairable) rescan(set, cell);
    });
    outcome.energy += reduction.sum(static_cast<std::size_t>(set.count), kTermsPerTask, [&](std::size_t cell) {
      const double energy = scans_[set.first + cell].energy;
      return norm_.is_sum() ? energy : norm_.value(energy, cell_measure(set, static_cast<std::int32_t>(cell)));
    });
  }
  outcome.min_scaled_jacobian = -reduction.largest(
      scans_.size(), kTermsPerTask, [&](std::size_t cell) { return -scans_[cell].scaled_jacobian; }, -1);
  outcome.invalid = static_cast<std::int64_t>(reduction.sum(
      scans_.size(), kTermsPerTask, [&](std::size_t cell) { return scans_[cell].smallest_jacobian > 0 ? 0.0 : 1.0; }));
  count_kernels(operations, watch);
  if (measure_ > 0) outcome.energy /= measure_;
  if (!norm_.is_sum()) outcome.energy = std::pow(outcome.energy, 1 / norm_.p);
  return outcome;
}

// === Sweeps ==============================================================================================

SweepOutcome Sweeper::sweep() {
  visits_.resize(problem_.free.size());  // only the first sweep allocates
  visited_at_.resize(problem_.free.size());
  if (!holds_deformation(problem_)) rebuild();
  if (meter_ != nullptr) meter_->begin(Activity::Sweep, static_cast<std::int64_t>(problem_.free.size()));
  const Stopwatch watch;
  for (std::size_t colour = 0; colour + 1 < coloured_.colours.size(); ++colour) {
    team_.look_together();
    const std::int32_t first = coloured_.colours[colour], count = coloured_.colours[colour + 1] - first;
    team_.for_each(count, grain_, [&](std::int32_t group) {
      static thread_local AlignedVector<double> scratch(NodeStar::kMostNumbers);
      std::int64_t now = clock_;
      for (std::int32_t i = coloured_.groups[first + group]; i < coloured_.groups[first + group + 1]; ++i) {
        team_.look();
        visits_[coloured_.nodes[i]] = visit(coloured_.nodes[i], ++now, scratch.data());
      }
      if (meter_ != nullptr) meter_->add(coloured_.groups[first + group + 1] - coloured_.groups[first + group]);
    });
    clock_ += largest_group_;
  }
  SweepOutcome outcome;
  const Reduction reduction(team_);
  const auto sum = [&](const auto& of) {
    return reduction.sum(visits_.size(), kTermsPerTask, [&](std::size_t rank) { return of(visits_[rank]); });
  };
  outcome.residual =
      reduction.largest(visits_.size(), kTermsPerTask, [&](std::size_t rank) { return visits_[rank].step; });
  outcome.gradient_norm = std::sqrt(sum([](const Visit& visit) { return visit.squared_gradient; }));
  outcome.visited = static_cast<std::int64_t>(sum([](const Visit& visit) { return visit.made ? 1.0 : 0.0; }));
  count_kernels(sum([&](const Visit& visit) { return operations_of(visit); }), watch);
  return outcome;
}

bool Sweeper::at_rest(std::int32_t rank) const {
  if (rest_ < 0 || visited_at_[rank] == 0) return false;
  for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
    const Incidence& at = problem_.incidences[i];
    if (moved_at_[problem_.sets[at.set].first + at.cell] > visited_at_[rank]) return false;
  }
  return true;
}

std::int32_t Sweeper::points_of_star(std::int32_t rank) const {
  std::int32_t points = 0;
  for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i)
    points += problem_.sets[problem_.incidences[i].set].points;
  return points;
}

double Sweeper::operations_of(const Visit& visit) const {
  const int a_point =
      (visit.made ? point_.expand : 0) + visit.trials * point_.energy_after + (visit.moved ? point_.move : 0);
  return static_cast<double>(visit.points) * a_point;
}

void Sweeper::note_move(std::int32_t rank, std::int64_t now, double length) {
  for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
    const Incidence& at = problem_.incidences[i];
    const std::int32_t cell = problem_.sets[at.set].first + at.cell;
    changed_[cell] = drifted_[cell] = 1;
    if (rest_ < 0) continue;  // no node ever rests
    moves_[cell] += length / problem_.cell_size[cell];
    if (moves_[cell] <= rest_) continue;
    moves_[cell] = 0;
    moved_at_[cell] = now;
  }
}

double Sweeper::star_delta_squared(std::int32_t rank, std::span<StarCell> star) const {
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < star.size(); ++i) {
    const Incidence& at = problem_.incidences[problem_.offsets[rank] + i];
    const CellSet& set = problem_.sets[at.set];
    if (is_unrepairable(set, at.cell)) continue;
    smallest = std::min(smallest, kernels_.smallest_jacobian(star.subspan(i, 1)));
  }
  return delta_squared_for(smallest);
}

Sweeper::Visit Sweeper::visit(std::int32_t rank, std::int64_t now, double* scratch) {
  if (at_rest(rank)) return {};
  visited_at_[rank] = now;
  const int d = problem_.dimension;
  NodeStar gathered(problem_, rank, line_size_, scratch);
  const std::span<StarCell> star = gathered.cells();
  if (regularisation_ == Regularisation::Patch) {
    const double delta_squared = star_delta_squared(rank, star);
    for (StarCell& cell : star)
      if (cell.delta_squared != kUnrepairableDeltaSquared) cell.delta_squared = delta_squared;
  }

  const StarExpansion here = expand(kernels_, star, norm_);
  const std::array<double, 3> full = newton_step(here, d);
  double slope = 0, length = 0, squared_gradient = 0;
  for (int i = 0; i < d; ++i) {
    slope += full[i] * here.gradient[i];
    length += full[i] * full[i];
    squared_gradient += here.gradient[i] * here.gradient[i];
  }
  Visit visit{std::sqrt(length) * problem_.inverse_size[rank], squared_gradient, points_of_star(rank), 0, true, false};
  if (!(length > 0) || !(slope < 0)) return visit;

  std::array<double, 3> step{};
  const AcceptedStep accepted =
      backtrack({here.energy, slope, kEnergyNoise * here.measure, kMostTrials}, [&](double alpha) {
        step = {alpha * full[0], alpha * full[1], alpha * full[2]};
        ++visit.trials;
        return energy_after(kernels_, star, step.data(), norm_);
      });
  if (accepted.alpha == 0) {
    // Near J = 0 the kept function of J may differ from that of F by more than can be gained: compute it from F again.
    for (const StarCell& cell : star)
      if (cell.jacobian_function != nullptr)
        kernels_.take_function(cell.deformation, cell.stride, cell.jacobian_function);
    return visit;
  }
  kernels_.move(star, step.data());
  visit.moved = true;
  double* x = problem_.positions.data() + static_cast<std::size_t>(problem_.free[rank]) * d;
  for (int i = 0; i < d; ++i) x[i] += step[i];
  if (visit.step > rest_) visited_at_[rank] = 0;  // the node is not at rest yet
  note_move(rank, now, accepted.alpha * std::sqrt(length));
  return visit;
}

}  // namespace varimesh
