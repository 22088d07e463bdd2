#include "core/terms/cell_energy.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/index.h"
#include "core/base/io/large_arrays.h"
#include "core/kernels/node_star.h"
#include "core/terms/power_of_two.h"

namespace varimesh {
namespace {

constexpr std::int32_t kBatchesPerTask = 2;
constexpr std::int32_t kCellsPerTask = 64;
constexpr std::size_t kCellsPerSum = 512;
constexpr std::int64_t kSamples = 64;       // the size of the Hessian is taken from at least this many nodes, if there
constexpr std::int64_t kMostBetween = 256;  // are as many, and from at least one in this many
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Of a matrix with d rows whose entries are `stride` apart, row by row.
double determinant(const double* F, int stride, int d) {
  const auto entry = [&](int i, int j) { return F[(i * d + j) * stride]; };
  const auto minor = [&](int i, int a, int b) { return entry(i, a) * entry(i + 1, b) - entry(i, b) * entry(i + 1, a); };
  if (d == 2) return minor(0, 0, 1);
  return entry(0, 0) * minor(1, 1, 2) - entry(0, 1) * minor(1, 0, 2) + entry(0, 2) * minor(1, 0, 1);
}

}  // namespace

CellEnergy::CellEnergy(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
                       const Team& team, const ProblemShare* share)
    : problem_(problem),
      kernels_(kernels),
      hessian_(hessian),
      norm_(norm),
      team_(team),
      share_(share),
      own_nodes_(share != nullptr ? share->own_nodes : static_cast<std::int32_t>(problem.free.size())),
      reduction_(team, share != nullptr ? *share->ranks : one_rank()),
      batches_(make_batches(problem, hessian, team)),
      scans_(at(problem.cells)) {
  if (share_ != nullptr) make_room_for_ghosts();
}

CellEnergy::~CellEnergy() {
  for (CellSet& set : problem_.sets) set.energy_slope.clear();
}

void CellEnergy::make_room_for_ghosts() {
  for (std::size_t s = 0; s < batches_.size(); ++s) {
    const std::size_t places = (at(share_->places[s]) + kBatch - 1) / kBatch * kBatch;
    const std::size_t numbers = places * at(problem_.sets[s].nodes_per_cell) * 2 * at(problem_.dimension);
    if (batches_[s].contributions.size() >= numbers) continue;
    UntouchedVector<float>().swap(batches_[s].contributions);
    resize_large(batches_[s].contributions, numbers);
  }
}

void CellEnergy::exchange_contributions(int width) {
  if (share_ == nullptr) return;
  std::vector<float*> arrays;
  for (BatchSet& set : batches_) arrays.push_back(set.contributions.data());
  share_->contributions.exchange<float>(arrays, at(width), *share_->ranks);
}

std::int64_t CellEnergy::gradient_work() const {
  std::int64_t work = 0;
  for (const BatchSet& set : batches_) work += std::int64_t{kBatch} * set.count;
  return work;
}

std::span<double> CellEnergy::room() {
  const auto largest =
      std::ranges::max_element(batches_, {}, [](const BatchSet& set) { return set.contributions.size(); });
  if (largest == batches_.end()) return {};
  // Two floats take the memory of a double, and the arrays begin on a cache line.
  return {reinterpret_cast<double*>(largest->contributions.data()), largest->contributions.size() / 2};
}

// ===== The energy =====

void CellEnergy::scan() {
  const Stopwatch watch;
  for (const CellSet& set : problem_.sets)
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
      static thread_local AlignedVector<double> deformation;
      deformation.resize(set.deformation_size());
      kernels_.deform(set, cell, problem_.positions, deformation.data());
      scans_[at(set.first + cell)] = kernels_.scan(set, cell, deformation.data(), nullptr);
    });
  count_kernels(operations_.scan, watch);
}

double CellEnergy::value() {
  double energy = 0;
  for (const CellSet& set : problem_.sets)
    energy += reduction_.sum(at(set.count), kCellsPerSum, [&](std::size_t cell) {
      const CellScan& scan = scans_[at(set.first) + cell];
      if (set.delta_squared[cell] == 0 && !(scan.smallest_jacobian > 0)) return kInfinity;
      if (!weights_.empty()) return weights_[at(set.first) + cell] * scan.energy;
      return norm_.value(scan.energy, cell_measure(set, static_cast<std::int32_t>(cell)));
    });
  return std::isfinite(energy) ? energy / volume_ : kInfinity;
}

double CellEnergy::rounding() {
  double sum = 0;
  for (const CellSet& set : problem_.sets)
    sum += reduction_.sum(at(set.count), kCellsPerSum, [&](std::size_t cell) {
      const double volume = cell_measure(set, static_cast<std::int32_t>(cell));
      return norm_.slope(scans_[at(set.first) + cell].energy, volume) * volume;
    });
  return sum;
}

// ===== Its scale =====

double CellEnergy::largest_entry(std::int32_t rank) {
  team_.look();
  NodeStar star(problem_, rank);
  const std::int64_t first = problem_.offsets[at(rank)];
  const std::size_t cells = at(problem_.offsets[at(rank) + 1] - first);
  std::vector<std::size_t> begin{0};
  for (std::size_t i = 0; i < cells; ++i)
    begin.push_back(begin[i] + problem_.sets[at(problem_.incidences[at(first) + i].set)].deformation_size());
  AlignedVector<double> deformation(begin.back());
  for (std::size_t i = 0; i < cells; ++i) {
    const Incidence& incidence = problem_.incidences[at(first) + i];
    star.cells()[i].deformation = deformation.data() + begin[i];
    star.cells()[i].jacobian_function = nullptr;
    kernels_.deform(problem_.sets[at(incidence.set)], incidence.cell, problem_.positions, star.cells()[i].deformation);
  }
  double largest = 0;
  for (const double h : kernels_.expand(star.cells()).hessian) largest = std::max(largest, std::abs(h));
  return largest;
}

void CellEnergy::fit_scale() {
  if (!norm_.is_sum()) scan();
  fit_scale_to_scans();
}

std::vector<std::int32_t> CellEnergy::every(std::int64_t stride) const {
  std::vector<std::int32_t> ranks;
  if (share_ == nullptr) {
    for (std::int64_t rank = 0; rank < own_nodes_; rank += stride) ranks.push_back(static_cast<std::int32_t>(rank));
    return ranks;
  }
  for (std::int32_t rank = 0; rank < own_nodes_; ++rank)
    if (share_->numbers[at(rank)] % stride == 0) ranks.push_back(rank);
  return ranks;
}

void CellEnergy::fit_scale_to_scans() {
  const std::int64_t nodes = share_ != nullptr ? share_->free_nodes : own_nodes_;
  const std::vector<std::int32_t> samples = every(std::clamp<std::int64_t>(nodes / kSamples, 1, kMostBetween));
  double largest =
      reduction_.largest(samples.size(), 4, [&](std::size_t sample) { return largest_entry(samples[sample]); });
  if (!norm_.is_sum()) {
    double slope = 0;
    for (const CellSet& set : problem_.sets)
      slope = std::max(slope, reduction_.largest(at(set.count), kCellsPerSum, [&](std::size_t cell) {
        return norm_.slope(scans_[at(set.first) + cell].energy, cell_measure(set, static_cast<std::int32_t>(cell)));
      }));
    largest *= slope;
  }
  scale_ = power_of_two(largest);
}

double CellEnergy::slope(const CellSet& set, std::int32_t cell) const {
  const double slope = weights_.empty() ? norm_.slope(scans_[at(set.first + cell)].energy, cell_measure(set, cell))
                                        : weights_[at(set.first + cell)] / volume_;
  return slope / scale_;
}

void CellEnergy::set_slopes() {
  for (CellSet& set : problem_.sets) {
    set.energy_slope.resize(at(set.count));
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) { set.energy_slope[at(cell)] = slope(set, cell); });
  }
}

std::vector<double> CellEnergy::curvatures() const {
  std::vector<double> curvatures;
  if (norm_.is_sum()) return curvatures;
  curvatures.resize(at(problem_.cells));
  for (const CellSet& set : problem_.sets)
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
      const double energy = scans_[at(set.first + cell)].energy;
      curvatures[at(set.first + cell)] = norm_.curvature(energy, cell_measure(set, cell)) / scale_;
    });
  return curvatures;
}

// ===== Its derivatives =====

template <class Work>
void CellEnergy::for_batches(const Work& work) {
  change_kind_of_numbers();
  const Stopwatch watch;
  for (std::size_t s = 0; s < batches_.size(); ++s) {
    CellSet& set = problem_.sets[s];
    set.energy_slope.resize(at(set.count));
    team_.for_each(batches_[s].count, kBatchesPerTask, [&](std::int32_t b) {
      static thread_local AlignedVector<double> deformation;
      deformation.resize(kBatch * set.deformation_size());
      for (std::int32_t cell = b * kBatch; cell < std::min(set.count, (b + 1) * kBatch); ++cell) {
        team_.look();
        double* F = deformation.data() + at(cell - b * kBatch) * set.deformation_size();
        kernels_.deform(set, cell, problem_.positions, F);
        scans_[at(set.first + cell)] = kernels_.scan(set, cell, F, nullptr);
        set.energy_slope[at(cell)] = slope(set, cell);
      }
      work(s, b, deformation.data());
      count_batch();
    });
  }
  count_kernels(operations_.scan + operations_.gradient, watch);
}

void CellEnergy::gradient(std::span<double> gradient) {
  for_batches([&](std::size_t s, std::int32_t b, const double* F) { hessian_.gradient(batches_[s], b, F); });
  add_up_gradient(gradient);
}

void CellEnergy::linearise(std::span<double> gradient) {
  if (!norm_.is_sum() && cell_gradients_.empty())
    for (const BatchSet& set : batches_) cell_gradients_.emplace_back(set.contributions.size() / 2);
  for_batches([&](std::size_t s, std::int32_t b, const double* F) {
    hessian_.linearise(batches_[s], b, F);
    if (!norm_.is_sum()) keep_cell_gradients(s, b);
  });
  if (share_ != nullptr && !norm_.is_sum()) {
    std::vector<float*> arrays;
    for (AlignedVector<float>& of_set : cell_gradients_) arrays.push_back(of_set.data());
    share_->contributions.exchange<float>(arrays, at(problem_.dimension), *share_->ranks);
  }
  add_up_gradient(gradient);
}

void CellEnergy::add_up_gradient(std::span<double> gradient) {
  const int d = problem_.dimension;
  exchange_contributions(2 * d);
  team_.for_each(own_nodes_, kNodesPerTask, [&](std::int32_t rank) {
    std::array<double, 3> sum{};
    for (std::int64_t i = problem_.offsets[at(rank)]; i < problem_.offsets[at(rank) + 1]; ++i) {
      const Incidence& incidence = problem_.incidences[at(i)];
      const BatchSet& set = batches_[at(incidence.set)];
      const float* numbers = set.contributions.data() + set.contribution_index(incidence.cell, incidence.local, 2 * d);
      for (int k = 0; k < d; ++k) sum[at(k)] += static_cast<double>(numbers[k]) + static_cast<double>(numbers[d + k]);
    }
    for (int k = 0; k < d; ++k) gradient[at(rank) * at(d) + at(k)] = sum[at(k)] * scale_;
  });
}

void CellEnergy::keep_convex_part(const Material& material) {
  for (std::size_t s = 0; s < batches_.size(); ++s) {
    const CellSet& set = problem_.sets[s];
    team_.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
      static thread_local AlignedVector<double> deformation;
      deformation.resize(set.deformation_size());
      kernels_.deform(set, cell, problem_.positions, deformation.data());
      for (int q = 0; q < set.points; ++q) {
        const double J = determinant(deformation.data() + q, set.stride, set.dimension);
        // f_Q = μ/2
        const double weight = 2 * static_cast<double>(batches_[s].kept(cell, q, KeptPartial::Q)) / material.mu;
        batches_[s].kept(cell, q, KeptPartial::J) = 0;
        float& second = batches_[s].kept(cell, q, KeptPartial::JJ);
        second = std::max(second, static_cast<float>(weight * material.lambda / (J * J + set.delta_squared[at(cell)])));
      }
    });
  }
}

void CellEnergy::node_blocks() {
  change_kind_of_numbers();
  const Stopwatch watch;
  for (BatchSet& set : batches_)
    team_.for_each(set.count, kBatchesPerTask, [&](std::int32_t b) {
      hessian_.node_blocks(set, b);
      count_batch();
    });
  count_kernels(operations_.blocks, watch);
  exchange_contributions(2 * problem_.dimension);
}

std::array<double, 6> CellEnergy::added_up_block(std::int32_t rank) const {
  const int d = problem_.dimension;
  std::array<double, 6> sum{};
  for (std::int64_t i = problem_.offsets[at(rank)]; i < problem_.offsets[at(rank) + 1]; ++i) {
    const Incidence& incidence = problem_.incidences[at(i)];
    const BatchSet& set = batches_[at(incidence.set)];
    const float* numbers = set.contributions.data() + set.contribution_index(incidence.cell, incidence.local, 2 * d);
    for (int entry = 0; entry < d * (d + 1) / 2; ++entry) sum[at(entry)] += static_cast<double>(numbers[entry]);
    if (norm_.is_sum()) continue;
    const float* gradient =
        cell_gradients_[at(incidence.set)].data() + set.contribution_index(incidence.cell, incidence.local, d);
    for (int k = 0, entry = 0; k < d; ++k)
      for (int l = 0; l <= k; ++l, ++entry)
        sum[at(entry)] += static_cast<double>(gradient[k]) * static_cast<double>(gradient[l]);
  }
  return sum;
}

double CellEnergy::multiply(std::span<const float> direction, std::span<float> product) {
  change_kind_of_numbers();
  const Stopwatch watch;
  for (std::size_t s = 0; s < batches_.size(); ++s)
    team_.for_each(batches_[s].count, kBatchesPerTask, [&](std::int32_t b) {
      hessian_.apply(batches_[s], b, direction);
      if (!norm_.is_sum()) add_norm_term(s, b, direction);
    });
  count_kernels(operations_.product, watch);
  exchange_contributions(problem_.dimension);
  return reduction_.sum_of_blocks(at(own_nodes_), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    return hessian_.add_up(problem_, batches_, direction.data(), product.data(), static_cast<std::int32_t>(begin),
                           static_cast<std::int32_t>(end));
  });
}

// ===== The p-norm =====

void CellEnergy::keep_cell_gradients(std::size_t s, std::int32_t b) {
  const CellSet& set = problem_.sets[s];
  const BatchSet& batches = batches_[s];
  const int d = problem_.dimension;
  for (std::int32_t cell = b * kBatch; cell < std::min(set.count, (b + 1) * kBatch); ++cell) {
    const double slope = set.energy_slope[at(cell)];
    const double curvature = norm_.curvature(scans_[at(set.first + cell)].energy, cell_measure(set, cell));
    // The contributions are gradients times slopes.
    const double factor = slope > 0 ? std::sqrt(curvature / scale_) / slope : 0;
    for (int n = 0; n < set.nodes_per_cell; ++n) {
      const float* from = batches.contributions.data() + batches.contribution_index(cell, n, 2 * d);
      float* to = cell_gradients_[s].data() + batches.contribution_index(cell, n, d);
      for (int k = 0; k < d; ++k) to[k] = static_cast<float>(factor * static_cast<double>(from[k]));
    }
  }
}

void CellEnergy::add_norm_term(std::size_t s, std::int32_t b, std::span<const float> direction) {
  BatchSet& set = batches_[s];
  const std::size_t d = at(problem_.dimension), nodes = at(set.cells->nodes_per_cell);
  for (std::int32_t cell = b * kBatch; cell < std::min(set.cells->count, (b + 1) * kBatch); ++cell) {
    const std::size_t lane = at(cell - b * kBatch);
    float along = 0;
    for (std::size_t n = 0; n < nodes; ++n) {
      const std::size_t rank = at(set.ranks[(at(b) * nodes + n) * kBatch + lane]);
      const float* gradient =
          cell_gradients_[s].data() + set.contribution_index(cell, static_cast<int>(n), problem_.dimension);
      for (std::size_t k = 0; k < d; ++k) along += gradient[k] * direction[rank * d + k];
    }
    for (std::size_t n = 0; n < nodes; ++n) {
      const std::size_t first = set.contribution_index(cell, static_cast<int>(n), problem_.dimension);
      for (std::size_t k = 0; k < d; ++k) set.contributions[first + k] += along * cell_gradients_[s][first + k];
    }
  }
}

}  // namespace varimesh
