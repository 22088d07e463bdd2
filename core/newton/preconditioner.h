// An approximate inverse of the whole mesh's Hessian.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/kernels/kernels.h"
#include "core/newton/coarse_kernels.h"
#include "core/newton/coarse_level.h"
#include "core/problem/problem.h"

namespace varimesh {

/// M⁻¹ = D⁻¹ + I V Iᵀ, with D the d × d blocks of the nodes, their eigenvalues made positive (no smaller than 1e-3 of
/// the block's largest), and I V Iᵀ the coarse level's part.
class Preconditioner {
 public:
  /// `batches` of the problem; apply() uses their parts.
  Preconditioner(const Problem& problem, std::vector<BatchSet>& batches, const Team& team);

  /// Takes the block of free node `rank`: xx, xy, yy, xz, yz, zz of the lower triangle by rows.
  void set_block(std::int32_t rank, const std::array<double, 6>& triangle);

  CoarseLevel& coarse() { return coarse_; }

  /// z = M⁻¹ r, d floats a free node; z has padded(d) more at its end, which are 0. Returns r · z, the
  /// same whatever the number of threads.
  double apply(std::span<const float> r, std::span<float> z);

 private:
  const Problem& problem_;
  const Team& team_;
  CoarseLevel coarse_;
  std::unique_ptr<CoarseKernels> kernels_;
  AlignedVector<float> inverse_blocks_;  ///< Lower triangle by rows, a free node.
  std::vector<double> partial_;          ///< Of r · z, a task's.
};

}  // namespace varimesh
