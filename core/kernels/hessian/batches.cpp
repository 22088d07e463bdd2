#include "core/kernels/hessian/batches.h"

#include <Eigen/Dense>
#include <algorithm>

#include "core/base/io/large_arrays.h"

namespace varimesh {
namespace {

constexpr std::int32_t kBatchesPerTask = 64;
constexpr std::size_t kNodesPerTask = 16384;
constexpr std::size_t kNumbersPerTask = 16384;

BatchSet make_batch_set(const CellSet& cells, const std::vector<std::int32_t>& rank, int entries, const Team& team) {
  const int d = cells.dimension, nodes = cells.nodes_per_cell;
  BatchSet set;
  set.cells = &cells;
  set.count = (cells.count + kBatch - 1) / kBatch;
  set.entries = entries;
  set.gradient = fold_gradient(cells);
  set.ranks.resize(static_cast<std::size_t>(set.count) * nodes * kBatch);
  team.for_each(set.count, kBatchesPerTask, [&](std::int32_t b) {
    for (int lane = 0; lane < kBatch; ++lane) {
      const std::int32_t cell = std::min(b * kBatch + lane, cells.count - 1);
      for (int n = 0; n < nodes; ++n)
        set.ranks[(static_cast<std::size_t>(b) * nodes + n) * kBatch + lane] =
            rank[cells.nodes[static_cast<std::size_t>(cell) * nodes + n]];
    }
  });
  set.squares.reserve(set.gradient.points.size() * static_cast<std::size_t>(nodes) *
                      static_cast<std::size_t>(triangle_size(d)));
  for (const int q : set.gradient.points)
    for (int n = 0; n < nodes; ++n) {
      Eigen::VectorXd slope(d);
      for (int k = 0; k < d; ++k) slope[k] = cells.derivatives_of(n)[k * cells.stride + q];
      slope = set.gradient.directions * slope;
      for (int k = 0; k < d; ++k)
        for (int l = 0; l <= k; ++l) set.squares.push_back(static_cast<float>(slope[k] * slope[l]));
    }
  resize_large(set.contributions, static_cast<std::size_t>(set.count) * nodes * 2 * d * kBatch);
  resize_large(set.linearisation, set.count * set.linearisation_size());
  resize_large(set.deformation, set.count * set.deformation_size());
  set.mean.resize(static_cast<std::size_t>(set.count) * (d * d + 1) * kBatch);
  set.inverse_target.resize(static_cast<std::size_t>(set.count) * (cells.affine ? 1 : cells.points) * d * d * kBatch);
  return set;
}

/// A⁻¹ of a cell at a point; for affine sets at point 0.
Eigen::MatrixXd inverse_target(const CellSet& cells, std::int32_t cell, int point) {
  const int d = cells.dimension, stride = cells.affine ? 1 : cells.stride;
  const double* from = cells.inverse_target_of(cell) + point;
  Eigen::MatrixXd inverse(d, d);
  for (int row = 0; row < d; ++row)
    for (int column = 0; column < d; ++column) inverse(row, column) = from[(row * d + column) * stride];
  return inverse;
}

}  // namespace

std::size_t BatchSet::linearisation_size() const { return static_cast<std::size_t>(cells->points) * entries * kBatch; }

std::size_t BatchSet::deformation_size() const {
  return static_cast<std::size_t>(cells->points) * cells->dimension * cells->dimension * kBatch;
}

std::vector<BatchSet> make_batches(const Problem& problem, const HessianKernels& kernels, const Team& team) {
  const std::size_t nodes = problem.positions.size() / problem.dimension;
  std::vector<std::int32_t> rank(nodes, static_cast<std::int32_t>(problem.free.size()));
  team.for_ranges(problem.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) rank[problem.free[f]] = static_cast<std::int32_t>(f);
  });
  std::vector<BatchSet> batches;
  for (const CellSet& cells : problem.sets) batches.push_back(make_batch_set(cells, rank, kernels.entries(), team));
  copy_targets(batches, team);
  return batches;
}

void copy_targets(std::vector<BatchSet>& batches, const Team& team) {
  for (BatchSet& set : batches) {
    const CellSet& cells = *set.cells;
    const int square = cells.dimension * cells.dimension, per_cell = cells.affine ? 1 : cells.points;
    set.left_factor.resize(cells.left_factor.empty() ? 0 : static_cast<std::size_t>(set.count) * square * kBatch);
    team.for_ranges(set.left_factor.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const std::int32_t lane = static_cast<std::int32_t>(i % kBatch),
                           b = static_cast<std::int32_t>(i / kBatch) / square;
        const double* factor = cells.left_factor_of(std::min(b * kBatch + lane, cells.count - 1));
        set.left_factor[i] = static_cast<float>(factor[i / kBatch % square]);
      }
    });
    const Eigen::MatrixXd to_s = set.gradient.directions.transpose().inverse();
    team.for_each(set.count * kBatch, kBatch * kBatchesPerTask, [&](std::int32_t cell) {
      for (int slot = 0; slot < per_cell; ++slot) {
        const Eigen::MatrixXd inverse =
            to_s * inverse_target(cells, std::min(cell, cells.count - 1), cells.affine ? 0 : set.gradient.points[slot]);
        const std::size_t place = static_cast<std::size_t>(cell / kBatch) * per_cell + slot;
        for (int entry = 0; entry < square; ++entry)
          set.inverse_target[(place * square + entry) * kBatch + cell % kBatch] =
              static_cast<float>(inverse(entry / cells.dimension, entry % cells.dimension));
      }
    });
  }
}

}  // namespace varimesh
