#include "core/solvers/descent/barrier.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/base/stopwatch.h"

namespace varimesh {
namespace {

constexpr std::int32_t kBatchesPerTask = 2;
constexpr std::size_t kNodesPerTask = 512;
constexpr std::size_t kCellsPerSum = 512;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

Barrier::Barrier(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, double volume,
                 const Team& team)
    : problem_(problem),
      kernels_(kernels),
      hessian_(hessian),
      volume_(volume),
      team_(team),
      reduction_(team),
      batches_(make_batches(problem, hessian, team)),
      scans_(problem.cells) {}

Barrier::~Barrier() {
  for (CellSet& set : problem_.sets) set.energy_slope.clear();
}

double Barrier::gradient(std::span<const double> weights, std::span<double> gradient) {
  const Stopwatch watch;
  for (std::size_t number = 0; number < batches_.size(); ++number) {
    CellSet& set = problem_.sets[number];
    set.energy_slope.resize(set.count);
    team_.for_each(batches_[number].count, kBatchesPerTask, [&](std::int32_t b) {
      static thread_local AlignedVector<double> deformation;
      deformation.resize(kBatch * set.deformation_size());
      for (std::int32_t cell = b * kBatch; cell < std::min(set.count, (b + 1) * kBatch); ++cell) {
        double* F = deformation.data() + (cell - b * kBatch) * set.deformation_size();
        kernels_.deform(set, cell, problem_.positions, F);
        scans_[set.first + cell] = kernels_.scan(set, cell, F, nullptr);
        set.energy_slope[cell] = weights[set.first + cell] / volume_;
      }
      hessian_.gradient(batches_[number], b, deformation.data());
    });
  }
  if (meter_ != nullptr)
    meter_->add_kernels({operations_.scan + operations_.gradient, watch.seconds() * team_.threads()});
  const std::size_t d = problem_.dimension;
  team_.for_ranges(problem_.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t rank = begin; rank < end; ++rank) {
      std::array<double, 3> sum{};
      for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
        const Incidence& at = problem_.incidences[i];
        const BatchSet& set = batches_[at.set];
        const float* numbers =
            set.contributions.data() + set.contribution_index(at.cell, at.local, 2 * static_cast<int>(d));
        for (std::size_t k = 0; k < d; ++k) sum[k] += static_cast<double>(numbers[k]) + numbers[d + k];
      }
      std::copy_n(sum.begin(), d, gradient.begin() + static_cast<std::ptrdiff_t>(rank * d));
    }
  });
  double energy = 0;
  for (const CellSet& set : problem_.sets)
    energy += reduction_.sum(set.count, kCellsPerSum, [&](std::size_t cell) {
      const CellScan& scan = scans_[set.first + cell];
      if (set.delta_squared[cell] == 0 && !(scan.smallest_jacobian > 0)) return kInfinity;
      return weights[set.first + cell] * scan.energy;
    });
  return std::isfinite(energy) ? energy / volume_ : kInfinity;
}

}  // namespace varimesh
