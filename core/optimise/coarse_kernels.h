// The preconditioner's loops over nodes, vectorised: a node's vector at a time, on any machine.
#pragma once

#include <cstdint>
#include <memory>

#include "core/optimise/aligned.h"

namespace varimesh {

/// Floats of a d × d block: d columns of padded(d).
constexpr int block_size(int dimension) { return dimension * padded(dimension); }

/// A symmetric matrix of d × d blocks with the unit matrix on its diagonal, and what a cycle on it reads and writes.
/// Vectors have padded(d) floats a node.
struct BlockRows {
  const std::int64_t* begin;   ///< Of each row's entries; rows + 1.
  const std::int32_t* column;  ///< Ascending in a row, without the diagonal.
  const std::int16_t* entry;   ///< d columns of d numbers a block, in steps of 1/kEntrySteps; one more at the end.
  const float* right;
  float* x;
  float* residual;
};
inline constexpr float kEntrySteps = 32767;

/// A sparse matrix of factors that apply to each component alike.
struct FactorRows {
  const std::int32_t* begin;  ///< rows + 1
  const std::int32_t* column;
  const float* factor;
};

/// Every function works on rows `first` to `last` − 1, which do not depend on each other.
class CoarseKernels {
 public:
  virtual ~CoarseKernels() = default;

  /// x_i = right_i − Σ_{j<i} K_ij x_j
  virtual void forward(const BlockRows& rows, std::int32_t first, std::int32_t last) const = 0;
  /// residual_i = −Σ_{j>i} K_ij x_j: what is left after forward() from zero.
  virtual void residual(const BlockRows& rows, std::int32_t first, std::int32_t last) const = 0;
  /// x_i = right_i − Σ_{j≠i} K_ij x_j
  virtual void backward(const BlockRows& rows, std::int32_t first, std::int32_t last) const = 0;
  /// to_i = B_i Σ factor_ij from_j, of d floats a node and one more at the end, into padded ones. B_i: block_size(d).
  virtual void restrict_to(const FactorRows& rows, const float* blocks, const float* from, float* to,
                           std::int32_t first, std::int32_t last) const = 0;
  /// z_i = B_i r_i + Σ factor_ij from_j, from padded vectors into d floats a node; returns r · z. B_i: block_size(d).
  /// Without rows (begin null) there is no sum.
  virtual double precondition(const FactorRows& rows, const float* from, const float* blocks, const float* r, float* z,
                              std::int32_t first, std::int32_t last) const = 0;
};

std::unique_ptr<CoarseKernels> make_coarse_kernels(int dimension);

}  // namespace varimesh
