// The preconditioner's loops over nodes, vectorised: one node's vector at a time on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "core/base/aligned.h"
#include "core/kernels/hessian/batches.h"
#include "core/preconditioner/coarse_space.h"

namespace varimesh {

/// A symmetric matrix of d × d blocks with the unit matrix on its diagonal, and the vectors of a cycle on it. Vectors
/// have padded(d) floats per node.
struct BlockRows {
  const std::int64_t* begin;   ///< rows + 1: where each row's blocks begin.
  const std::int32_t* column;  ///< By block: ascending in a row, without the diagonal.
  const std::int16_t* entry;   ///< d columns of d numbers per block, in steps of 1/kLargestFixedPoint; one more number.
  const float* right;
  float* x;
  float* residual;
};

/// Functions with a `first` and a `last` work on rows `first` to `last` − 1, which must not depend on each other.
class CoarseKernels {
 public:
  virtual ~CoarseKernels() = default;

  /// x_i = right_i − Σ_{j<i} K_ij x_j
  virtual void forward(const BlockRows& rows, std::int32_t first, std::int32_t last) const = 0;
  /// residual_i = −Σ_{j>i} K_ij x_j: the residual after forward() from x = 0.
  virtual void residual(const BlockRows& rows, std::int32_t first, std::int32_t last) const = 0;
  /// x_i = right_i − Σ_{j≠i} K_ij x_j
  virtual void backward(const BlockRows& rows, std::int32_t first, std::int32_t last) const = 0;
  /// The contributions of batch `b` become each cell's restriction of values at its nodes to its coarse nodes: Σ factor
  /// · value, with one row of `rows` per coarse node of the cell. `values`: d floats per free node, then padded(d)
  /// zeros.
  virtual void restrict_cells(BatchSet& set, std::int32_t b, const SparseRows& rows, const float* values) const = 0;
  /// to_i = B_i Σ contributions of the cells of coarse node i, which are cells[begin[i]] to cells[begin[i + 1] − 1].
  /// `to`: padded(d) floats per node. B_i: d columns of d numbers; one more number after the last block.
  virtual void add_up(const std::array<Contributions, kShapes>& contributions, const std::int64_t* begin,
                      const Incidence* cells, const float* blocks, float* to, std::int32_t first,
                      std::int32_t last) const = 0;
  /// z_i = B_i r_i, plus the value of `coarse` (padded(d) floats per coarse node) at free node i, interpolated in its
  /// first cell, if `space` has any nodes. r and z: d floats per free node. B_i: lower triangle by rows. Returns r · z.
  virtual double precondition(const Problem& problem, const CoarseSpace& space, const float* coarse,
                              const float* blocks, const float* r, float* z, std::int32_t first,
                              std::int32_t last) const = 0;
};

std::unique_ptr<CoarseKernels> make_coarse_kernels(int dimension);

}  // namespace varimesh
