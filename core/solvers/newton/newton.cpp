#include "core/solvers/newton/newton.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/line_search.h"
#include "core/solvers/newton/power_of_two.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNodesPerTask = 256;
constexpr std::int32_t kCellsPerTask = 64;
constexpr std::size_t kCellsPerSum = 512;
constexpr std::size_t kNumbersPerTask = 16384;
constexpr int kMostTrials = 30;         // of a line search
constexpr double kLargeStep = 0.05;     // of a cell's size: after a larger step the coarse level is assembled again
constexpr double kRough = 0.1;          // even the last step is solved to this share of its initial residual,
constexpr double kFinest = 1e-3;        // and no step is solved beyond this one
constexpr double kCurved = 0.3;         // of the tolerance: a larger square of the step shows in the next one
constexpr double kEnergyNoise = 1e-14;  // relative to Σ slope V: a smaller change of the energy is rounding

/// The share of its initial residual to which a step is solved, smaller the faster the gradient falls: S. C. Eisenstat,
/// H. F. Walker, SIAM J. Sci. Comput. 17, 1996. Gradients are in the preconditioner's norm.
double forcing_term(double gradient, double last) {
  if (!(last > 0)) return 0.1;
  return std::min(0.1, std::max(0.01, 0.9 * std::pow(gradient / last, 1.5)));
}

}  // namespace

Newton::Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
               double tolerance, const Team& team)
    : problem_(problem),
      kernels_(kernels),
      hessian_(hessian),
      norm_(norm),
      tolerance_(tolerance),
      team_(team),
      reduction_(team),
      batches_(make_batches(problem, hessian, team)),
      preconditioner_(problem, batches_, team),
      unknowns_(problem.free.size() * problem.dimension),
      gradient_(unknowns_),
      step_(unknowns_),
      residual_(unknowns_),
      direction_(unknowns_ + padded(problem.dimension)),
      product_(unknowns_ + padded(problem.dimension)),
      scans_(problem.cells) {}

NewtonOutcome Newton::step() {
  NewtonOutcome outcome;
  linearise();
  outcome.gradient_norm =
      std::sqrt(reduction_.sum(unknowns_, kNumbersPerTask, [&](std::size_t i) { return gradient_[i] * gradient_[i]; }));
  const double gradient_scale = scale_residual();
  const double along = preconditioner_.apply(residual_, product_);
  const double norm = std::sqrt(std::max(0.0, along)) * gradient_scale / std::sqrt(hessian_scale_);
  solve(along, forcing_term(norm, last_gradient_), gradient_scale / hessian_scale_, outcome);
  last_gradient_ = norm;
  if (coarse_is_old_) products_when_new_ = outcome.products;
  const double slope = reduction_.sum(unknowns_, kNumbersPerTask, [&](std::size_t i) {
    step_[i] *= gradient_scale / hessian_scale_;
    return gradient_[i] * step_[i];
  });
  outcome.residual = largest_displacement(step_);
  outcome.failed = !std::isfinite(slope) || (outcome.residual == 0 && outcome.gradient_norm > 0);
  const double scale = gradient_scale / hessian_scale_, left = distance_left(outcome.residual, scale);
  const bool is_last =
      !outcome.failed && outcome.linear_solve == LinearSolve::Solved && outcome.residual + left <= tolerance_;
  if (slope < 0 && !outcome.failed) outcome.damping = search(slope);
  // If no step was taken, the nodes are still where the step and what is left of it were measured.
  outcome.converged = is_last && (outcome.damping == 0 || left + defect(gradient_scale) <= tolerance_);
  // The coarse level is used again as long as the mesh hardly changes.
  coarse_is_old_ =
      outcome.damping < 1 || outcome.residual > kLargeStep || outcome.products > 2 * products_when_new_ + 20;
  return outcome;
}

void Newton::add_norm_term(std::size_t b, std::int32_t batch) {
  BatchSet& set = batches_[b];
  const int d = problem_.dimension, nodes = set.cells->nodes_per_cell;
  for (int lane = 0; lane < kBatch && batch * kBatch + lane < set.cells->count; ++lane) {
    const std::int32_t cell = batch * kBatch + lane;
    float along = 0;
    for (int n = 0; n < nodes; ++n) {
      const std::size_t rank = set.ranks[(static_cast<std::size_t>(batch) * nodes + n) * kBatch + lane];
      const float* gradient = cell_gradients_[b].data() + set.contribution_index(cell, n, d);
      for (int k = 0; k < d; ++k) along += gradient[k] * direction_[rank * d + k];
    }
    for (int n = 0; n < nodes; ++n) {
      const std::size_t at = set.contribution_index(cell, n, d);
      for (int k = 0; k < d; ++k) set.contributions[at + k] += along * cell_gradients_[b][at + k];
    }
  }
}

double Newton::multiply() {
  const Stopwatch watch;
  for (std::size_t set = 0; set < batches_.size(); ++set)
    team_.for_each(batches_[set].count, 2, [&](std::int32_t b) {
      hessian_.apply(batches_[set], b, direction_);
      if (!norm_.is_sum()) add_norm_term(set, b);
    });
  count_kernels(operations_.product, watch);
  const auto nodes = static_cast<std::int32_t>(problem_.free.size());
  return reduction_.sum(static_cast<std::size_t>((nodes + kNodesPerTask - 1) / kNodesPerTask), 1,
                        [&](std::size_t task) {
                          const std::int32_t first = static_cast<std::int32_t>(task) * kNodesPerTask;
                          return hessian_.add_up(problem_, batches_, direction_.data(), product_.data(), first,
                                                 std::min(nodes, first + kNodesPerTask));
                        });
}

double Newton::scale_residual() {
  const double scale = power_of_two(
      reduction_.largest(unknowns_, kNumbersPerTask, [&](std::size_t i) { return std::abs(gradient_[i]); }));
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) residual_[i] = static_cast<float>(-gradient_[i] / scale);
  });
  return scale;
}

template <class Number>
double Newton::largest_displacement(const std::vector<Number>& displacements) {
  const std::size_t d = problem_.dimension;
  return std::sqrt(reduction_.largest(problem_.free.size(), kNumbersPerTask / 4, [&](std::size_t rank) {
    double square = 0;
    for (std::size_t k = 0; k < d; ++k) {
      const double component = displacements[rank * d + k];
      square += component * component;
    }
    const double inverse_size = problem_.inverse_size[rank];
    return square * inverse_size * inverse_size;
  }));
}

double Newton::distance_left(double step, double scale) {
  const double residual = largest_displacement(product_) * scale;
  if (residual == 0) return 0;
  const Spectrum spectrum = spectrum_.estimate(ritz_);
  if (!(spectrum.smallest > 0)) return std::numeric_limits<double>::infinity();
  const double any = residual / spectrum.smallest, reduction = spectrum.reduction(ritz_.count());
  return reduction < 1 ? std::min(any, step * reduction / (1 - reduction)) : any;
}

double Newton::defect(double gradient_scale) {
  std::copy(residual_.begin(), residual_.end(), direction_.begin());
  begin_assembly(false);
  find_gradient();
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) gradient_[i] += gradient_scale * static_cast<double>(direction_[i]);
  });
  const double scale = scale_residual() / hessian_scale_;
  preconditioner_.apply(residual_, product_);
  return largest_displacement(product_) * scale / spectrum_.estimate(ritz_).smallest;
}

bool Newton::is_solved(double share, double forcing, double scale) {
  if (share > kRough) return false;
  if (rough_) return true;
  const double step = largest_displacement(step_) * scale;
  if (step <= tolerance_) {
    const double left = distance_left(step, scale);
    // The last step need not be solved further once it is known to be the last.
    if (step + left <= tolerance_) return true;
    if (std::isinf(left)) return false;  // only more products can tell
  }
  if (share > forcing) return false;
  // `left` is what the next step would have to do. If it is just above the tolerance, a few more products save a step,
  // unless the curvature of the energy, which is about the square of the step, takes the next step above it anyway.
  const double left = share * step;
  return step * step > kCurved * tolerance_ || left <= 0.7 * tolerance_ || left > 5 * tolerance_ || share <= kFinest;
}

/// The vectors of conjugate gradients on H x = −G, for conjugate_gradients(): x is step_, r is residual_, p is
/// direction_; H p and then z are in product_. `initial`: G · M⁻¹ G.
struct Newton::LinearSystem {
  Newton& newton;
  double initial, forcing, scale;

  double multiply() {
    const double curvature = newton.multiply();
    newton.count(1);
    return curvature;
  }
  void advance(double alpha) {
    newton.ritz_.advance(alpha);
    const auto alpha_float = static_cast<float>(alpha);
    newton.team_.for_ranges(newton.unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        newton.step_[i] += alpha * newton.direction_[i];
        newton.residual_[i] -= alpha_float * newton.product_[i];
      }
    });
  }
  double precondition() { return newton.preconditioner_.apply(newton.residual_, newton.product_); }
  bool is_solved(double rz) { return newton.is_solved(std::sqrt(rz / initial), forcing, scale); }
  void turn(double beta) {
    newton.ritz_.turn(beta);
    const auto beta_float = static_cast<float>(beta);
    newton.team_.for_ranges(newton.unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        newton.direction_[i] = newton.product_[i] + beta_float * newton.direction_[i];
    });
  }
};

void Newton::solve(double initial, double forcing, double scale, NewtonOutcome& outcome) {
  std::fill(step_.begin(), step_.end(), 0.0);
  std::copy(product_.begin(), product_.end(), direction_.begin());
  ritz_.clear();
  if (meter_ != nullptr) meter_->begin(Activity::Products);
  LinearSystem system{*this, initial, forcing, scale};
  const ConjugateGradients result = conjugate_gradients(system, initial, most_products_);
  spectrum_.note(ritz_);
  outcome.products = result.products;
  const bool reached_most = result.products == most_products_ && !result.solved;
  outcome.linear_solve = result.negative_curvature ? LinearSolve::NegativeCurvature
                         : reached_most            ? LinearSolve::MostProducts
                                                   : LinearSolve::Solved;
  // The quadratic model is not bounded below. The step is what was found so far, or the first direction.
  if (result.negative_curvature && result.products == 1) std::copy_n(direction_.begin(), unknowns_, step_.begin());
}

double Newton::search(double slope) {
  const std::size_t d = problem_.dimension;
  std::vector<double>& start = gradient_;
  team_.for_ranges(problem_.free.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) std::copy_n(&problem_.positions[problem_.free[f] * d], d, &start[f * d]);
  });
  const double before = scanned_energy();
  // Computing F again may, by rounding, turn over a cell that is about to vanish: then no step can be judged.
  if (!std::isfinite(before)) return 0;
  const double noise = 100 * (kEnergyNoise * rounding());
  try {
    const AcceptedStep accepted =
        backtrack({before, slope, noise, kMostTrials}, [&](double alpha) { return energy_at(alpha, start); });
    if (accepted.alpha == 0) energy_at(0, start);
    return accepted.alpha;
  } catch (const Interrupted&) {
    place(0, start, team_.without_stop());
    throw;
  }
}

void Newton::place(double alpha, const std::vector<double>& start, const Team& team) {
  const std::size_t d = problem_.dimension;
  team.for_ranges(problem_.free.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      for (std::size_t k = 0; k < d; ++k)
        problem_.positions[problem_.free[f] * d + k] = start[f * d + k] + alpha * step_[f * d + k];
  });
}

double Newton::energy_at(double alpha, const std::vector<double>& start) {
  place(alpha, start, team_);
  scan_all();
  return scanned_energy();
}

void Newton::scan_all() {
  const Stopwatch watch;
  for (const CellSet& set : problem_.sets)
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
      static thread_local AlignedVector<double> deformation;
      deformation.resize(set.deformation_size());
      kernels_.deform(set, cell, problem_.positions, deformation.data());
      scans_[set.first + cell] = kernels_.scan(set, cell, deformation.data(), nullptr);
    });
  count_kernels(operations_.scan, watch);
}

double Newton::rounding() {
  double sum = 0;
  for (const CellSet& set : problem_.sets)
    sum += reduction_.sum(set.count, kCellsPerSum, [&](std::size_t cell) {
      const double volume = cell_measure(set, static_cast<std::int32_t>(cell));
      return norm_.slope(scans_[set.first + cell].energy, volume) * volume;
    });
  return sum;
}

double Newton::scanned_energy() {
  double energy = 0;
  for (const CellSet& set : problem_.sets)
    energy += reduction_.sum(set.count, kCellsPerSum, [&](std::size_t cell) {
      const CellScan& scan = scans_[set.first + cell];
      if (set.delta_squared[cell] == 0 && !(scan.smallest_jacobian > 0)) return std::numeric_limits<double>::infinity();
      return norm_.value(scan.energy, cell_measure(set, static_cast<std::int32_t>(cell)));
    });
  return std::isfinite(energy) ? energy : std::numeric_limits<double>::infinity();
}

}  // namespace varimesh
