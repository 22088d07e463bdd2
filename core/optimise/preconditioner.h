// An approximate inverse of the whole mesh's Hessian.
#pragma once

#include <span>
#include <vector>

#include "core/optimise/cells.h"
#include "core/optimise/kernels.h"
#include "core/team.h"

namespace varimesh {

/// z = D⁻¹ r, with D the exact d × d blocks of the nodes, their eigenvalues made positive: no smaller than 1e-3 of the
/// block's largest.
class Preconditioner {
 public:
  Preconditioner(const Problem& problem, const Team& team);

  /// Takes the block of free node `rank` from its patch's expansion.
  void set_block(std::int32_t rank, const PatchExpansion& expansion);

  /// z = M⁻¹ r; d floats a free node.
  void apply(std::span<const float> r, std::span<float> z) const;

 private:
  const Problem& problem_;
  const Team& team_;
  std::vector<float> inverse_blocks_;  ///< d·d a free node.
};

}  // namespace varimesh
