// Cells side by side: sixteen at a time, a lane a cell, for products of the whole mesh's Hessian with a direction.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/index.h"
#include "core/energy/material.h"
#include "core/hessian/folded_gradient.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Cells in a batch, whatever the width of the machine's vectors: one AVX-512 vector of floats, two of AVX2.
inline constexpr int kBatch = 16;

/// Where the first number of a cell's node is in BatchSet::parts, of a set with so many nodes a cell; the others
/// follow.
inline std::size_t part_index(std::int32_t cell, int node, std::uint32_t nodes, int width) {
  const auto number = static_cast<std::uint32_t>(cell);
  return ((static_cast<std::size_t>(number / kBatch) * nodes + node) * kBatch + number % kBatch) * width;
}

/// The batches of one CellSet. Innermost in every array but `parts` is the lane. Lanes past the last cell repeat it,
/// with weight 0.
struct BatchSet {
  const CellSet* cells = nullptr;
  std::int32_t count = 0;        ///< Batches.
  int entries = 0;               ///< Numbers a point that `linearise` keeps.
  FoldedGradient gradient;       ///< Points are in the order of its slots in every array here.
  AlignedVector<float> squares;  ///< points × nodes × d (d + 1)/2: ∂φ_n/∂s_k ∂φ_n/∂s_l, lower triangle by rows.
  /// count × (affine ? 1 : points) × d·d × lane: A⁻¹ of the coordinates s that `gradient` has: dF = (∂u/∂s) A_s⁻¹.
  AlignedVector<float> inverse_target;
  AlignedVector<float> left_factor;    ///< count × d·d × lane; empty: 1.
  AlignedVector<float> linearisation;  ///< count × points × entries × lane.
  /// F of a cell in steps from its mean, a 32767th of its largest difference from that: count × points × d·d × lane.
  AlignedVector<std::int16_t> deformation;
  AlignedVector<float> mean;  ///< count × (d·d + 1) × lane: the mean of F over a cell's points, and the step.
  std::vector<std::int32_t>
      ranks;  ///< count × nodes × lane: rank of the node among the free ones; free.size() if fixed.
  /// count × nodes × lane × width: each cell's part of what is summed over a node's cells, one after the other: of the
  /// product, d wide; of the gradient and of the node's own block of the Hessian, 2 d wide; of a coarse space's node,
  /// d wide.
  AlignedVector<float> parts;

  std::size_t linearisation_size() const;  ///< Of a batch.
  std::size_t deformation_size() const;    ///< Likewise.
  /// Where the first number of a cell's node is in `parts`; the others follow.
  std::size_t part_index(std::int32_t cell, int node, int width) const {
    return varimesh::part_index(cell, node, static_cast<std::uint32_t>(cells->nodes_per_cell), width);
  }
};

/// Numbers in a symmetric matrix of d·d rows.
constexpr int tensor_size(int dimension) { return triangle_size(dimension * dimension); }

/// Where a set's parts are, at hand for loops over nodes.
struct PartsOf {
  const float* data;
  std::uint32_t nodes;  ///< A cell.
};

/// Of every set; a cell of set b has parts at nodes(b) nodes.
template <class Nodes>
std::array<PartsOf, kShapes> parts_of(const std::vector<BatchSet>& batches, const Nodes& nodes) {
  std::array<PartsOf, kShapes> parts{};
  for (std::size_t b = 0; b < batches.size(); ++b)
    parts[b] = {batches[b].parts.data(), static_cast<std::uint32_t>(nodes(b))};
  return parts;
}

/// The second derivative of the energy, prepared at the present deformation gradients and applied to directions.
class HessianKernels {
 public:
  virtual ~HessianKernels() = default;

  /// Numbers that linearise() keeps a point.
  virtual int entries() const = 0;

  /// Keeps what products need of batch `b`: F, to 16 bits, and the energy's partial derivatives times the weights and
  /// the cell's slope. `deformation`: F of its cells, as CellSet::deformation has them. The parts become the cells'
  /// gradients times their slopes, each component in two floats that add up to its first 48 bits: d high ones, then d
  /// low ones.
  virtual void linearise(BatchSet& set, std::int32_t b, const double* deformation) const = 0;

  /// The parts become the second derivatives of the cells' energies in each node alone, times their slopes: lower
  /// triangles by rows, d (d + 1)/2 of the 2 d numbers. Of what linearise() has kept.
  virtual void node_blocks(BatchSet& set, std::int32_t b) const = 0;

  /// The parts become the cells' Hessian times `direction` (d floats a free node, then padded(d) zeros, for the
  /// fixed ones).
  virtual void apply(BatchSet& set, std::int32_t b, std::span<const float> direction) const = 0;

  /// The product: the sum of each free node's parts, in the order of its incidences, for the nodes `first` to `last`
  /// − 1. Returns its product with the direction.
  virtual double add_up(const Problem& problem, const std::vector<BatchSet>& batches, const float* direction,
                        float* product, std::int32_t first, std::int32_t last) const = 0;

  /// The cells' mean tensors M with dF ↦ Σ w dP : dF ≈ dG_ik M(ij, kl) dG_jl for dG constant in a cell:
  ///     M(ij, kl) = Σ 2 w f_Q δ_ij (A⁻¹A⁻ᵀ)_kl + w max(f_JJ, 0) (C A⁻ᵀ)_ik (C A⁻ᵀ)_jl,
  /// the positive part of the Hessian: f_J dC is left out (for constant f_J it is a null Lagrangian), and so are the
  /// mixed terms. A strain's μ stands beside 2 f_Q. `out`: tensor_size(d) a cell of the set: lower triangle by rows
  /// of M as a symmetric matrix from (i k) to (j l).
  virtual void mean_tensors(const BatchSet& set, std::int32_t b, std::vector<float>& out) const = 0;
};

std::unique_ptr<HessianKernels> make_hessian_kernels(const Material& material, int dimension);

/// Batches of the problem's cells, with tables and targets in place.
std::vector<BatchSet> make_batches(const Problem& problem, const HessianKernels& kernels);

/// The targets anew, after they changed.
void copy_targets(std::vector<BatchSet>& batches);

}  // namespace varimesh
