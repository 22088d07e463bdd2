// The part of Newton's method that prepares a step: the gradient, and what products and the preconditioner need.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/kernels/node_star.h"
#include "core/solvers/newton/newton.h"
#include "core/solvers/newton/power_of_two.h"

namespace varimesh {
namespace {

constexpr std::int32_t kNodesPerTask = 256;
constexpr std::int32_t kBatchesPerTask = 4;
constexpr std::size_t kCellsPerSum = 512;
constexpr std::size_t kSamples = 64;       // the size of the Hessian is taken from at least this many nodes, if there
constexpr std::size_t kMostBetween = 256;  // are as many, and from at least one in this many

}  // namespace

double Newton::largest_entry(std::int32_t rank) {
  team_.look();
  NodeStar star(problem_, rank);
  const std::int64_t first = problem_.offsets[rank];
  const auto cells = static_cast<std::int32_t>(problem_.offsets[rank + 1] - first);
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
  double largest = reduction_.largest((nodes + stride - 1) / stride, 4, [&](std::size_t sample) {
    return largest_entry(static_cast<std::int32_t>(sample * stride));
  });
  if (!norm_.is_sum()) {
    scan_all();
    double slope = 0;
    for (const CellSet& set : problem_.sets)
      slope = std::max(slope, reduction_.largest(set.count, kCellsPerSum, [&](std::size_t cell) {
        return norm_.slope(scans_[set.first + cell].energy, cell_measure(set, static_cast<std::int32_t>(cell)));
      }));
    largest *= slope;
  }
  hessian_scale_ = power_of_two(largest);
  for (CellSet& set : problem_.sets) set.energy_slope.assign(set.count, 1 / hessian_scale_);
}

void Newton::begin_assembly(bool whole) {
  if (meter_ == nullptr) return;
  std::int64_t work = whole && coarse_is_old_ ? preconditioner_.assembly_work() : 0;
  for (const BatchSet& set : batches_) work += std::int64_t{whole ? 2 * kBatch : kBatch} * set.count;
  meter_->begin(Activity::Assembly, work);
}

void Newton::linearise() {
  begin_assembly(true);
  scale_hessian();
  if (!norm_.is_sum() && cell_gradients_.empty())
    for (const BatchSet& set : batches_) cell_gradients_.emplace_back(set.contributions.size() / 2);
  find_gradient();
  const auto nodes = static_cast<std::int32_t>(problem_.free.size());
  const Stopwatch watch;
  for (BatchSet& set : batches_)
    team_.for_each(set.count, kBatchesPerTask, [&](std::int32_t b) {
      hessian_.node_blocks(set, b);
      count(kBatch);
    });
  count_kernels(operations_.blocks, watch);
  team_.for_each(nodes, kNodesPerTask,
                 [&](std::int32_t rank) { preconditioner_.set_block(rank, added_up_block(rank)); });
  if (coarse_is_old_) preconditioner_.assemble(hessian_, meter_);
}

void Newton::find_gradient() {
  const Stopwatch watch;
  for (std::size_t set = 0; set < batches_.size(); ++set)
    team_.for_each(batches_[set].count, kBatchesPerTask, [&](std::int32_t b) {
      linearise_batch(set, b);
      count(kBatch);
    });
  count_kernels(operations_.scan + operations_.gradient, watch);
  team_.for_each(static_cast<std::int32_t>(problem_.free.size()), kNodesPerTask,
                 [&](std::int32_t rank) { add_up_gradient(rank); });
}

void Newton::linearise_batch(std::size_t number, std::int32_t b) {
  CellSet& set = problem_.sets[number];
  static thread_local AlignedVector<double> deformation;
  deformation.resize(kBatch * set.deformation_size());
  for (std::int32_t cell = b * kBatch; cell < std::min(set.count, (b + 1) * kBatch); ++cell) {
    team_.look();
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
    // The contributions are gradients times slopes.
    const double factor = slope > 0 ? std::sqrt(curvature / hessian_scale_) / slope : 0;
    for (int n = 0; n < set.nodes_per_cell; ++n)
      for (int k = 0; k < d; ++k)
        cell_gradients_[number][batches.contribution_index(cell, n, d) + k] =
            static_cast<float>(factor * batches.contributions[batches.contribution_index(cell, n, 2 * d) + k]);
  }
}

void Newton::add_up_gradient(std::int32_t rank) {
  const int d = problem_.dimension;
  for (int k = 0; k < d; ++k) {
    double sum = 0;
    for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
      const Incidence& at = problem_.incidences[i];
      const BatchSet& set = batches_[at.set];
      const float* numbers = set.contributions.data() + set.contribution_index(at.cell, at.local, 2 * d);
      sum += static_cast<double>(numbers[k]) + numbers[d + k];
    }
    gradient_[static_cast<std::size_t>(rank) * d + k] = sum * hessian_scale_;
  }
}

std::array<double, 6> Newton::added_up_block(std::int32_t rank) const {
  const int d = problem_.dimension;
  std::array<double, 6> sum{};
  for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
    const Incidence& at = problem_.incidences[i];
    const BatchSet& set = batches_[at.set];
    const float* numbers = set.contributions.data() + set.contribution_index(at.cell, at.local, 2 * d);
    for (int entry = 0; entry < d * (d + 1) / 2; ++entry) sum[entry] += numbers[entry];
    if (norm_.is_sum()) continue;
    const float* gradient = cell_gradients_[at.set].data() + set.contribution_index(at.cell, at.local, d);
    for (int k = 0, entry = 0; k < d; ++k)
      for (int l = 0; l <= k; ++l, ++entry) sum[entry] += static_cast<double>(gradient[k]) * gradient[l];
  }
  return sum;
}

}  // namespace varimesh
