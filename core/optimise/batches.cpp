#include "core/optimise/batches.h"

#include <Eigen/Dense>
#include <algorithm>

namespace varimesh {
namespace {

BatchBlock make_batch_block(const CellBlock& cells, const std::vector<std::int32_t>& rank, int entries) {
  const int d = cells.dimension, nodes = cells.nodes_per_cell;
  BatchBlock block;
  block.cells = &cells;
  block.count = (cells.count + kBatch - 1) / kBatch;
  block.entries = entries;
  block.gradient = fold_gradient(cells);
  block.ranks.resize(static_cast<std::size_t>(block.count) * nodes * kBatch);
  for (std::int32_t b = 0; b < block.count; ++b)
    for (int lane = 0; lane < kBatch; ++lane) {
      const std::int32_t cell = std::min(b * kBatch + lane, cells.count - 1);
      for (int n = 0; n < nodes; ++n)
        block.ranks[(static_cast<std::size_t>(b) * nodes + n) * kBatch + lane] =
            rank[cells.nodes[static_cast<std::size_t>(cell) * nodes + n]];
    }
  for (const int q : block.gradient.points)
    for (int n = 0; n < nodes; ++n) {
      Eigen::VectorXd slope(d);
      for (int k = 0; k < d; ++k) slope[k] = cells.derivatives_of(n)[k * cells.stride + q];
      slope = block.gradient.directions * slope;
      for (int k = 0; k < d; ++k)
        for (int l = 0; l <= k; ++l) block.squares.push_back(static_cast<float>(slope[k] * slope[l]));
    }
  block.parts.resize(static_cast<std::size_t>(block.count) * nodes * 2 * d * kBatch);
  block.linearisation.resize(block.count * block.linearisation_size());
  block.deformation.resize(block.count * block.deformation_size());
  block.mean.resize(static_cast<std::size_t>(block.count) * (d * d + 1) * kBatch);
  block.inverse_target.resize(static_cast<std::size_t>(block.count) * (cells.affine ? 1 : cells.points) * d * d *
                              kBatch);
  return block;
}

/// A⁻¹ of a cell at a point; where affine, at point 0.
Eigen::MatrixXd inverse_target(const CellBlock& cells, std::int32_t cell, int point) {
  const int d = cells.dimension, stride = cells.affine ? 1 : cells.stride;
  const double* from = cells.inverse_target_of(cell) + point;
  Eigen::MatrixXd inverse(d, d);
  for (int row = 0; row < d; ++row)
    for (int column = 0; column < d; ++column) inverse(row, column) = from[(row * d + column) * stride];
  return inverse;
}

}  // namespace

std::size_t BatchBlock::linearisation_size() const {
  return static_cast<std::size_t>(cells->points) * entries * kBatch;
}

std::size_t BatchBlock::deformation_size() const {
  return static_cast<std::size_t>(cells->points) * cells->dimension * cells->dimension * kBatch;
}

std::vector<BatchBlock> make_batches(const Problem& problem, const HessianKernels& kernels) {
  const std::size_t nodes = problem.positions.size() / problem.dimension;
  std::vector<std::int32_t> rank(nodes, static_cast<std::int32_t>(problem.free.size()));
  for (std::size_t f = 0; f < problem.free.size(); ++f) rank[problem.free[f]] = static_cast<std::int32_t>(f);
  std::vector<BatchBlock> batches;
  for (const CellBlock& cells : problem.blocks) batches.push_back(make_batch_block(cells, rank, kernels.entries()));
  copy_targets(batches);
  return batches;
}

void copy_targets(std::vector<BatchBlock>& batches) {
  for (BatchBlock& block : batches) {
    const CellBlock& cells = *block.cells;
    const int square = cells.dimension * cells.dimension, per_cell = cells.affine ? 1 : cells.points;
    block.left_factor.resize(cells.left_factor.empty() ? 0 : static_cast<std::size_t>(block.count) * square * kBatch);
    for (std::size_t i = 0; i < block.left_factor.size(); ++i) {
      const std::int32_t lane = static_cast<std::int32_t>(i % kBatch),
                         b = static_cast<std::int32_t>(i / kBatch) / square;
      const double* factor = cells.left_factor_of(std::min(b * kBatch + lane, cells.count - 1));
      block.left_factor[i] = static_cast<float>(factor[i / kBatch % square]);
    }
    const Eigen::MatrixXd to_s = block.gradient.directions.transpose().inverse();
    for (std::int32_t cell = 0; cell < block.count * kBatch; ++cell)
      for (int slot = 0; slot < per_cell; ++slot) {
        const Eigen::MatrixXd inverse = to_s * inverse_target(cells, std::min(cell, cells.count - 1),
                                                              cells.affine ? 0 : block.gradient.points[slot]);
        const std::size_t place = static_cast<std::size_t>(cell / kBatch) * per_cell + slot;
        for (int entry = 0; entry < square; ++entry)
          block.inverse_target[(place * square + entry) * kBatch + cell % kBatch] =
              static_cast<float>(inverse(entry / cells.dimension, entry % cells.dimension));
      }
  }
}

}  // namespace varimesh
