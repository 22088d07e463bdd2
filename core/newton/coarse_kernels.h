// The preconditioner's loops over nodes, vectorised: a node's vector at a time, on any machine.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "core/base/aligned.h"
#include "core/hessian/batches.h"
#include "core/newton/coarse_space.h"

namespace varimesh {

/// A symmetric matrix of d × d blocks with the unit matrix on its diagonal, and what a cycle on it reads and writes.
/// Vectors have padded(d) floats a node.
struct BlockRows {
  const std::int64_t* begin;   ///< Of each row's entries; rows + 1.
  const std::int32_t* column;  ///< Ascending in a row, without the diagonal.
  const std::int16_t* entry;   ///< d columns of d numbers a set, in steps of 1/kLargestFixedPoint; one more at the end.
  const float* right;
  float* x;
  float* residual;
};

/// Functions with a `first` and a `last` work on rows `first` to `last` − 1, which do not depend on each other.
class CoarseKernels {
 public:
  virtual ~CoarseKernels() = default;

  /// x_i = right_i − Σ_{j<i} K_ij x_j
  virtual void forward(const BlockRows& rows, std::int32_t first, std::int32_t last) const = 0;
  /// residual_i = −Σ_{j>i} K_ij x_j: what is left after forward() from zero.
  virtual void residual(const BlockRows& rows, std::int32_t first, std::int32_t last) const = 0;
  /// x_i = right_i − Σ_{j≠i} K_ij x_j
  virtual void backward(const BlockRows& rows, std::int32_t first, std::int32_t last) const = 0;
  /// The parts of a batch's cells become what each gives its coarse nodes of values at its own: Σ `rows` values, a row
  /// a coarse node of the cell. `values`: d floats a free node and padded(d) zeros.
  virtual void restrict_cells(BatchSet& set, std::int32_t b, const SparseRows& rows, const float* values) const = 0;
  /// to_i = B_i Σ the parts of coarse node i's cells, into padded vectors. B_i: d columns of d,
  /// and one number more after the last; cells[begin[i]], …
  virtual void add_up(const std::array<PartsOf, kShapes>& parts, const std::int32_t* begin, const Incidence* cells,
                      const float* blocks, float* to, std::int32_t first, std::int32_t last) const = 0;
  /// z_i = B_i r_i, plus what free node i gets from its first cell's coarse nodes, where `space` has any: of `coarse`,
  /// padded vectors. r and z have d floats a node. Returns r · z. B_i: the lower triangle by
  /// rows.
  virtual double precondition(const Problem& problem, const CoarseSpace& space, const float* coarse,
                              const float* blocks, const float* r, float* z, std::int32_t first,
                              std::int32_t last) const = 0;
};

std::unique_ptr<CoarseKernels> make_coarse_kernels(int dimension);

}  // namespace varimesh
