#include "core/newton/newton.h"

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "core/kernels/node_star.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNodesPerTask = 256;
constexpr std::int32_t kCellsPerTask = 64;
constexpr std::int32_t kBatchesPerTask = 4;
constexpr std::size_t kCellsPerSum = 512;
constexpr std::size_t kNumbersPerTask = 16384;
constexpr std::size_t kSamples = 64;       // of the Hessian's size, at least, where there are as many nodes
constexpr std::size_t kMostBetween = 256;  // nodes from one to the next
constexpr int kMostProducts = 1000;        // a Newton step
constexpr int kMostHalvings = 30;
constexpr double kLargeStep = 1e-3;  // after which the coarse level is assembled again
constexpr double kRough = 0.1;       // the share of its beginning to which even the last step is solved,
constexpr double kFinest = 1e-3;     // and the least that a step is
constexpr double kArmijo = 1e-4;
constexpr double kEnergyNoise = 1e-14;  // of Σ slope V: below it an energy's change is rounding

/// A scale for numbers of this size; being a power of two it adds no rounding of its own.
double power_of_two(double size) { return size > 0 && std::isfinite(size) ? std::ldexp(1.0, std::ilogb(size)) : 1.0; }

/// Solve the more tightly the faster the gradient falls (Eisenstat, Walker, SIAM J. Sci. Comput. 17, 1996), in the
/// preconditioner's norm.
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
      batches_(make_batches(problem, hessian)),
      preconditioner_(problem, batches_, team),
      unknowns_(problem.free.size() * problem.dimension),
      gradient_(unknowns_),
      step_(unknowns_),
      residual_(unknowns_),
      direction_(unknowns_ + padded(problem.dimension)),
      product_(unknowns_ + padded(problem.dimension)),
      scans_(problem.cells) {}

template <class Term, class Combine>
double Newton::reduce(std::size_t count, std::size_t grain, const Term& term, const Combine& combine) {
  const std::size_t tasks = (count + grain - 1) / grain;
  partial_.resize(std::max(partial_.size(), tasks));
  team_.for_each(static_cast<std::int32_t>(tasks), 1, [&](std::int32_t task) {
    double one = 0;
    for (std::size_t i = task * grain; i < std::min(count, (task + 1) * grain); ++i) one = combine(one, term(i));
    partial_[task] = one;
  });
  return std::accumulate(partial_.begin(), partial_.begin() + static_cast<std::ptrdiff_t>(tasks), 0.0, combine);
}

template <class Term>
double Newton::add_up(std::size_t count, std::size_t grain, const Term& term) {
  return reduce(count, grain, term, std::plus<>());
}

template <class Term>
double Newton::largest_of(std::size_t count, std::size_t grain, const Term& term) {
  return reduce(count, grain, term, [](double a, double b) { return std::max(a, b); });
}

NewtonOutcome Newton::step() {
  NewtonOutcome outcome;
  linearise();
  outcome.gradient_norm =
      std::sqrt(add_up(unknowns_, kNumbersPerTask, [&](std::size_t i) { return gradient_[i] * gradient_[i]; }));
  // What goes to single precision is of order one, whatever the constants and the p-norm make of it.
  const double gradient_scale =
      power_of_two(largest_of(unknowns_, kNumbersPerTask, [&](std::size_t i) { return std::abs(gradient_[i]); }));
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) residual_[i] = static_cast<float>(-gradient_[i] / gradient_scale);
  });
  const double along = preconditioner_.apply(residual_, product_);
  const double norm = std::sqrt(std::max(0.0, along)) * gradient_scale / std::sqrt(hessian_scale_);
  conjugate_gradients(along, forcing_term(norm, last_gradient_), gradient_scale / hessian_scale_, outcome);
  last_gradient_ = norm;
  if (coarse_is_old_) products_when_new_ = outcome.products;
  const double slope = add_up(unknowns_, kNumbersPerTask, [&](std::size_t i) {
    step_[i] *= gradient_scale / hessian_scale_;
    return gradient_[i] * step_[i];
  });
  outcome.residual = largest_displacement();
  outcome.failed = !std::isfinite(slope) || (outcome.residual == 0 && outcome.gradient_norm > 0);
  if (slope < 0 && !outcome.failed) outcome.damping = search(slope);
  // A coarse level serves as long as the mesh hardly changes by it.
  coarse_is_old_ =
      outcome.damping < 1 || outcome.residual > kLargeStep || outcome.products > 2 * products_when_new_ + 20;
  return outcome;
}

double Newton::largest_entry(std::int32_t rank) {
  NodeStar star(problem_, rank);
  const std::int32_t first = problem_.offsets[rank], cells = problem_.offsets[rank + 1] - first;
  std::vector<std::size_t> begin{0};
  for (std::int32_t i = 0; i < cells; ++i)
    begin.push_back(begin[i] + problem_.sets[problem_.incidences[first + i].set].deformation_size());
  AlignedVector<double> deformation(begin.back());
  for (std::int32_t i = 0; i < cells; ++i) {
    const Incidence& at = problem_.incidences[first + i];
    star.cells()[i].deformation = deformation.data() + begin[i];
    star.cells()[i].jacobian_function = nullptr;
    kernels_.deform(problem_.sets[at.set], at.cell, problem_.positions, star.cells()[i].deformation);
  }
  double largest = 0;
  for (const double h : kernels_.expand(star.cells()).hessian) largest = std::max(largest, std::abs(h));
  return largest;
}

void Newton::scale_hessian() {
  const std::size_t nodes = problem_.free.size(), stride = std::clamp<std::size_t>(nodes / kSamples, 1, kMostBetween);
  double largest = largest_of((nodes + stride - 1) / stride, 4, [&](std::size_t sample) {
    return largest_entry(static_cast<std::int32_t>(sample * stride));
  });
  if (!norm_.is_sum()) {
    scan_all();
    double slope = 0;
    for (const CellSet& set : problem_.sets)
      slope = std::max(slope, largest_of(set.count, kCellsPerSum, [&](std::size_t cell) {
                         return norm_.slope(scans_[set.first + cell].energy,
                                            cell_measure(set, static_cast<std::int32_t>(cell)));
                       }));
    largest *= slope;
  }
  hessian_scale_ = power_of_two(largest);
  for (CellSet& set : problem_.sets) set.energy_slope.assign(set.count, 1 / hessian_scale_);
}

void Newton::linearise() {
  scale_hessian();
  if (!norm_.is_sum() && cell_gradients_.empty())
    for (const BatchSet& set : batches_) cell_gradients_.emplace_back(set.parts.size() / 2);
  for (std::size_t set = 0; set < batches_.size(); ++set)
    team_.for_each(batches_[set].count, kBatchesPerTask, [&](std::int32_t b) { linearise_batch(set, b); });
  const auto nodes = static_cast<std::int32_t>(problem_.free.size());
  team_.for_each(nodes, kNodesPerTask, [&](std::int32_t rank) { add_up_gradient(rank); });
  for (BatchSet& set : batches_)
    team_.for_each(set.count, kBatchesPerTask, [&](std::int32_t b) { hessian_.node_blocks(set, b); });
  team_.for_each(nodes, kNodesPerTask,
                 [&](std::int32_t rank) { preconditioner_.set_block(rank, added_up_block(rank)); });
  if (coarse_is_old_) preconditioner_.coarse().assemble(hessian_);
}

void Newton::linearise_batch(std::size_t number, std::int32_t b) {
  CellSet& set = problem_.sets[number];
  static thread_local AlignedVector<double> deformation;
  deformation.resize(kBatch * set.deformation_size());
  for (std::int32_t cell = b * kBatch; cell < std::min(set.count, (b + 1) * kBatch); ++cell) {
    double* F = deformation.data() + (cell - b * kBatch) * set.deformation_size();
    kernels_.deform(set, cell, problem_.positions, F);
    const CellScan scan = scans_[set.first + cell] = kernels_.scan(set, cell, F, nullptr);
    if (!norm_.is_sum()) set.energy_slope[cell] = norm_.slope(scan.energy, cell_measure(set, cell)) / hessian_scale_;
  }
  hessian_.linearise(batches_[number], b, deformation.data());
  if (!norm_.is_sum()) keep_cell_gradients(number, b);
}

void Newton::keep_cell_gradients(std::size_t number, std::int32_t b) {
  const CellSet& set = problem_.sets[number];
  const BatchSet& batches = batches_[number];
  const int d = problem_.dimension;
  for (std::int32_t cell = b * kBatch; cell < std::min(set.count, (b + 1) * kBatch); ++cell) {
    const double slope = set.energy_slope[cell];
    const double curvature = norm_.curvature(scans_[set.first + cell].energy, cell_measure(set, cell));
    // The parts have the slope in them.
    const double factor = slope > 0 ? std::sqrt(curvature / hessian_scale_) / slope : 0;
    for (int n = 0; n < set.nodes_per_cell; ++n)
      for (int k = 0; k < d; ++k)
        cell_gradients_[number][batches.part_index(cell, n, d) + k] =
            static_cast<float>(factor * batches.parts[batches.part_index(cell, n, 2 * d) + k]);
  }
}

void Newton::add_up_gradient(std::int32_t rank) {
  const int d = problem_.dimension;
  for (int k = 0; k < d; ++k) {
    double sum = 0;
    for (std::int32_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
      const Incidence& at = problem_.incidences[i];
      const BatchSet& set = batches_[at.set];
      const float* part = set.parts.data() + set.part_index(at.cell, at.local, 2 * d);
      sum += static_cast<double>(part[k]) + part[d + k];
    }
    gradient_[static_cast<std::size_t>(rank) * d + k] = sum * hessian_scale_;
  }
}

std::array<double, 6> Newton::added_up_block(std::int32_t rank) const {
  const int d = problem_.dimension;
  std::array<double, 6> sum{};
  for (std::int32_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
    const Incidence& at = problem_.incidences[i];
    const BatchSet& set = batches_[at.set];
    const float* part = set.parts.data() + set.part_index(at.cell, at.local, 2 * d);
    for (int entry = 0; entry < d * (d + 1) / 2; ++entry) sum[entry] += part[entry];
    if (norm_.is_sum()) continue;
    const float* gradient = cell_gradients_[at.set].data() + set.part_index(at.cell, at.local, d);
    for (int k = 0, entry = 0; k < d; ++k)
      for (int l = 0; l <= k; ++l, ++entry) sum[entry] += static_cast<double>(gradient[k]) * gradient[l];
  }
  return sum;
}

void Newton::add_norm_part(std::size_t b, std::int32_t batch) {
  BatchSet& set = batches_[b];
  const int d = problem_.dimension, nodes = set.cells->nodes_per_cell;
  for (int lane = 0; lane < kBatch && batch * kBatch + lane < set.cells->count; ++lane) {
    const std::int32_t cell = batch * kBatch + lane;
    float along = 0;
    for (int n = 0; n < nodes; ++n) {
      const std::size_t rank = set.ranks[(static_cast<std::size_t>(batch) * nodes + n) * kBatch + lane];
      const float* gradient = cell_gradients_[b].data() + set.part_index(cell, n, d);
      for (int k = 0; k < d; ++k) along += gradient[k] * direction_[rank * d + k];
    }
    for (int n = 0; n < nodes; ++n) {
      const std::size_t at = set.part_index(cell, n, d);
      for (int k = 0; k < d; ++k) set.parts[at + k] += along * cell_gradients_[b][at + k];
    }
  }
}

double Newton::multiply() {
  for (std::size_t set = 0; set < batches_.size(); ++set)
    team_.for_each(batches_[set].count, 2, [&](std::int32_t b) {
      hessian_.apply(batches_[set], b, direction_);
      if (!norm_.is_sum()) add_norm_part(set, b);
    });
  const auto nodes = static_cast<std::int32_t>(problem_.free.size());
  return add_up(static_cast<std::size_t>((nodes + kNodesPerTask - 1) / kNodesPerTask), 1, [&](std::size_t task) {
    const std::int32_t first = static_cast<std::int32_t>(task) * kNodesPerTask;
    return hessian_.add_up(problem_, batches_, direction_.data(), product_.data(), first,
                           std::min(nodes, first + kNodesPerTask));
  });
}

double Newton::largest_displacement() {
  const std::size_t d = problem_.dimension;
  return std::sqrt(largest_of(problem_.free.size(), kNumbersPerTask / 4, [&](std::size_t rank) {
    double square = 0;
    for (std::size_t k = 0; k < d; ++k) square += step_[rank * d + k] * step_[rank * d + k];
    return square;
  }));
}

bool Newton::is_solved(double share, double forcing, double scale) {
  if (share > kRough) return false;
  const double step = largest_displacement() * scale;
  // The last step only has to be known to be it.
  if (step * (1 + share) <= tolerance_) return true;
  if (share > forcing) return false;
  // What is left to the next step. Where that would be just above the tolerance, a few products more save a step.
  const double left = share * step;
  return left <= 0.7 * tolerance_ || left > 5 * tolerance_ || share <= kFinest;
}

void Newton::conjugate_gradients(double first, double forcing, double scale, NewtonOutcome& outcome) {
  std::fill(step_.begin(), step_.end(), 0.0);
  std::copy(product_.begin(), product_.end(), direction_.begin());
  double rz = first;
  while (outcome.products < kMostProducts && rz > 0) {
    const double curvature = multiply();
    ++outcome.products;
    if (!(curvature > 0)) {
      // Downhill for ever, as far as the quadratic model knows: go on with what there is, or down the first direction.
      outcome.cut_short = rz > kRough * kRough * first;
      if (outcome.products == 1) std::copy_n(direction_.begin(), unknowns_, step_.begin());
      break;
    }
    const double alpha = rz / curvature;
    const float alpha_float = static_cast<float>(alpha);
    team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        step_[i] += alpha * direction_[i];
        residual_[i] -= alpha_float * product_[i];
      }
    });
    const double next = preconditioner_.apply(residual_, product_);
    if (!(next > 0) || is_solved(std::sqrt(next / first), forcing, scale)) break;
    const float beta = static_cast<float>(next / rz);
    rz = next;
    team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) direction_[i] = product_[i] + beta * direction_[i];
    });
  }
}

double Newton::search(double slope) {
  const std::size_t d = problem_.dimension;
  std::vector<double>& start = gradient_;
  team_.for_ranges(problem_.free.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) std::copy_n(&problem_.positions[problem_.free[f] * d], d, &start[f * d]);
  });
  const double before = scanned_energy();
  // Rounding, as F is computed anew, may have turned a cell that was about to vanish: there is no step to judge then.
  if (!std::isfinite(before)) return 0;
  const double noise = kEnergyNoise * rounding();
  double alpha = 1;
  for (int halving = 0; halving < kMostHalvings; ++halving, alpha *= 0.5) {
    const double energy = energy_at(alpha, start);
    if (energy <= before + kArmijo * alpha * slope) return alpha;
    if (-slope < 100 * noise && energy <= before + 100 * noise) return alpha;
  }
  energy_at(0, start);
  return 0;
}

double Newton::energy_at(double alpha, const std::vector<double>& start) {
  const std::size_t d = problem_.dimension;
  team_.for_ranges(problem_.free.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      for (std::size_t k = 0; k < d; ++k)
        problem_.positions[problem_.free[f] * d + k] = start[f * d + k] + alpha * step_[f * d + k];
  });
  scan_all();
  return scanned_energy();
}

void Newton::scan_all() {
  for (const CellSet& set : problem_.sets)
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
      static thread_local AlignedVector<double> deformation;
      deformation.resize(set.deformation_size());
      kernels_.deform(set, cell, problem_.positions, deformation.data());
      scans_[set.first + cell] = kernels_.scan(set, cell, deformation.data(), nullptr);
    });
}

double Newton::rounding() {
  double sum = 0;
  for (const CellSet& set : problem_.sets)
    sum += add_up(set.count, kCellsPerSum, [&](std::size_t cell) {
      const double volume = cell_measure(set, static_cast<std::int32_t>(cell));
      return norm_.slope(scans_[set.first + cell].energy, volume) * volume;
    });
  return sum;
}

double Newton::scanned_energy() {
  double energy = 0;
  for (const CellSet& set : problem_.sets)
    energy += add_up(set.count, kCellsPerSum, [&](std::size_t cell) {
      const CellScan& scan = scans_[set.first + cell];
      if (set.delta_squared[cell] == 0 && !(scan.smallest_jacobian > 0)) return std::numeric_limits<double>::infinity();
      return norm_.value(scan.energy, cell_measure(set, static_cast<std::int32_t>(cell)));
    });
  return std::isfinite(energy) ? energy : std::numeric_limits<double>::infinity();
}

}  // namespace varimesh
