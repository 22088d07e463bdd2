// Batches of sixteen cells, one cell per vector lane, for products of the whole mesh's Hessian with a direction.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/index.h"
#include "core/base/team.h"
#include "core/energy/material.h"
#include "core/kernels/hessian/batch.h"
#include "core/kernels/hessian/folded_gradient.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Where the numbers of a node of a cell begin in BatchSet::contributions.
///
/// @param nodes nodes per cell of the set
/// @param width numbers per node of a cell
inline std::size_t contribution_index(std::int32_t cell, int node, std::uint32_t nodes, int width) {
  const auto number = static_cast<std::uint32_t>(cell);
  return ((static_cast<std::size_t>(number / kBatch) * nodes + node) * kBatch + number % kBatch) * width;
}

/// The batches of one CellSet. The innermost index of every array except `contributions` is the lane. Lanes past the
/// last cell repeat it with weight 0.
struct BatchSet {
  const CellSet* cells = nullptr;
  std::int32_t count = 0;        ///< Batches.
  int entries = 0;               ///< Numbers per point that HessianKernels::linearise() keeps.
  FoldedGradient gradient;       ///< All arrays here have the points in the order of its slots.
  AlignedVector<float> squares;  ///< points × nodes × d (d + 1)/2: ∂φ_n/∂s_k ∂φ_n/∂s_l, lower triangle by rows.
  /// count × (affine ? 1 : points) × d·d × lane: A_s⁻¹, which is A⁻¹ in the coordinates s of `gradient`: dF = (∂u/∂s)
  /// A_s⁻¹.
  UntouchedVector<float> inverse_target;
  AlignedVector<float> left_factor;      ///< count × d·d × lane; empty: L = 1.
  UntouchedVector<float> linearisation;  ///< count × points × entries × lane.
  /// count × points × d·d × lane: F minus the mean over the cell's points, in steps of 1/32767 of the cell's largest
  /// such difference.
  UntouchedVector<std::int16_t> deformation;
  UntouchedVector<float> mean;  ///< count × (d·d + 1) × lane: the mean of F over the cell's points, and the step.
  /// count × nodes × lane: rank of the node among the free nodes; Problem::free.size() if it is fixed.
  std::vector<std::int32_t> ranks;
  /// count × nodes × lane × width: what each cell contributes to a sum over the cells of a node. Used in turn for the
  /// product (width d), for the gradient and for the node's own block of the Hessian (width 2 d), and for the nodes of
  /// a coarse space (width d, coarse nodes instead of nodes).
  UntouchedVector<float> contributions;

  std::size_t linearisation_size() const;  ///< Numbers per batch.
  std::size_t deformation_size() const;    ///< Numbers per batch.
  /// Where the numbers of a node of a cell begin in `contributions`.
  std::size_t contribution_index(std::int32_t cell, int node, int width) const {
    return varimesh::contribution_index(cell, node, static_cast<std::uint32_t>(cells->nodes_per_cell), width);
  }
  /// What HessianKernels::linearise() has kept of a cell at a quadrature point.
  float& kept(std::int32_t cell, int point, KeptPartial partial) {
    const std::size_t slot = static_cast<std::size_t>(gradient.slots[static_cast<std::size_t>(point)]);
    return linearisation[static_cast<std::size_t>(cell / kBatch) * linearisation_size() +
                         (slot * static_cast<std::size_t>(entries) + static_cast<std::size_t>(partial)) * kBatch +
                         static_cast<std::size_t>(cell % kBatch)];
  }
};

/// Numbers in a symmetric matrix with d·d rows.
constexpr int tensor_size(int dimension) { return triangle_size(dimension * dimension); }

/// The contributions of one set, for loops over nodes.
struct Contributions {
  const float* data;
  std::uint32_t nodes;  ///< Per cell.
};

/// The contributions of every set; a cell of set b contributes to nodes(b) nodes.
template <class Nodes>
std::array<Contributions, kShapes> contributions_of(const std::vector<BatchSet>& batches, const Nodes& nodes) {
  std::array<Contributions, kShapes> result{};
  for (std::size_t b = 0; b < batches.size(); ++b)
    result[b] = {batches[b].contributions.data(), static_cast<std::uint32_t>(nodes(b))};
  return result;
}

/// The second derivative of the energy: linearise() prepares it at given deformation gradients, apply() multiplies it
/// with directions.
class HessianKernels {
 public:
  virtual ~HessianKernels() = default;

  /// Numbers per point that linearise() keeps.
  virtual int entries() const = 0;

  /// Keeps what products need of batch `b`: F in 16 bits, and the energy's partial derivatives times the weights and
  /// the cell's energy_slope. `deformation`: F of its cells, as in CellSet::deformation. The contributions become the
  /// cells' gradients times their slopes. Each component is two floats that add up to its first 48 bits: first the d
  /// high ones, then the d low ones.
  virtual void linearise(BatchSet& set, std::int32_t b, const double* deformation) const = 0;

  /// The contributions become those of linearise(), bit for bit, and nothing is kept. Those of the lanes past the last
  /// cell do not change.
  virtual void gradient(BatchSet& set, std::int32_t b, const double* deformation) const = 0;

  /// From what linearise() has kept: the contributions become each node's own d × d block of the cells' Hessians, times
  /// their slopes: lower triangles by rows, in the first d (d + 1)/2 of the 2 d numbers.
  virtual void node_blocks(BatchSet& set, std::int32_t b) const = 0;

  /// The contributions become the cells' Hessians times `direction` (d floats per free node, then padded(d) zeros for
  /// the fixed nodes).
  virtual void apply(BatchSet& set, std::int32_t b, std::span<const float> direction) const = 0;

  /// Adds up the product: `product` of a free node is the sum of its cells' contributions, in the order of its
  /// incidences. For the nodes `first` to `last` − 1; returns their part of direction · product.
  virtual double add_up(const Problem& problem, const std::vector<BatchSet>& batches, const float* direction,
                        float* product, std::int32_t first, std::int32_t last) const = 0;

  /// The cells' mean tensors M with Σ w dP : dF ≈ dG_ik M(ij, kl) dG_jl for a dG that is constant in the cell:
  ///     M(ij, kl) = Σ 2 w f_Q δ_ij (A⁻¹A⁻ᵀ)_kl + w max(f_JJ, 0) (C A⁻ᵀ)_ik (C A⁻ᵀ)_jl,
  /// the positive part of the Hessian. It leaves out f_J dC (for constant f_J a null Lagrangian) and the mixed terms.
  /// The μ of a strain term is added to 2 f_Q. `out`: tensor_size(d) numbers per cell of the set, M as a symmetric
  /// matrix from (i k) to (j l), lower triangle by rows.
  virtual void mean_tensors(const BatchSet& set, std::int32_t b, std::vector<float>& out) const = 0;
};

std::unique_ptr<HessianKernels> make_hessian_kernels(const Material& material, int dimension);

/// Batches of the problem's cells, with their tables and targets. Keeps pointers to the problem's sets. Call it inside
/// team.run().
std::vector<BatchSet> make_batches(const Problem& problem, const HessianKernels& kernels, const Team& team = Team(1));

/// Copies the targets again after they have changed. Call it inside team.run().
void copy_targets(std::vector<BatchSet>& batches, const Team& team = Team(1));

}  // namespace varimesh
