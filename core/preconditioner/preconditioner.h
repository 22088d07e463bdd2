// The preconditioner: an approximate inverse of the whole mesh's Hessian.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/base/work_meter.h"
#include "core/kernels/kernels.h"
#include "core/preconditioner/coarse_kernels.h"
#include "core/preconditioner/coarse_level.h"
#include "core/preconditioner/stretched_cells.h"
#include "core/problem/problem.h"
#include "core/ranks/whole_reduction.h"
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// M⁻¹ = D⁻¹ + I V Iᵀ + S. D has the d × d blocks of the nodes, with their eigenvalues made positive (at least 1e-3 of
/// the block's largest); I V Iᵀ is the coarse level; S solves on the few most stretched cells (stretched_cells.h).
class Preconditioner {
 public:
  /// `batches`: of the problem. apply() overwrites their contributions. All arguments are kept by reference. `part`:
  /// null, or the part that a rank has of a whole problem. `problem` is then the part's problem. All ranks call
  /// assemble() and apply() together, and each rank gets the numbers of its own nodes, with the same bits as without
  /// ranks.
  Preconditioner(const Problem& problem, std::vector<BatchSet>& batches, const Team& team,
                 const ProblemPart* part = nullptr);

  /// Sets the block of own free node `rank`: its lower triangle by rows, xx, xy, yy, xz, yz, zz.
  void set_block(std::int32_t rank, const std::array<double, 6>& triangle);

  /// Assembles the coarse level and the stretched cells from what `hessian` has linearised. The blocks are not set.
  /// `meter` may be null. It counts assembly_work().
  void assemble(const HessianKernels& hessian, WorkMeter* meter = nullptr);
  std::int64_t assembly_work() const { return coarse_.assembly_work(); }

  /// Reads or writes what the coarse level and the stretched cells are made from, if they will be used again
  /// (`is_used`).
  template <class Archive>
  void state(Archive& archive, bool is_used) {
    coarse_.state(archive, is_used);
    if constexpr (Archive::kReads)
      if (is_used && !archive.failed()) stretched_.assemble(coarse_.tensors());
  }

  CoarseLevel& coarse() { return coarse_; }

  /// z = M⁻¹ r, d floats per own free node; z has room for all free nodes, and padded(d) zeros at its end. Returns r ·
  /// z, which does not depend on the number of threads.
  double apply(std::span<const float> r, std::span<float> z);

 private:
  const Problem& problem_;
  const Team& team_;
  const ProblemPart* part_;
  std::size_t own_nodes_;  ///< So many at the beginning of Problem::free.
  CoarseLevel coarse_;
  StretchedCells stretched_;
  std::unique_ptr<CoarseKernels> kernels_;
  UntouchedVector<float> inverse_blocks_;  ///< By own free node: lower triangle by rows.
  WholeReduction reduction_;
};

}  // namespace varimesh
