// The p-norm's own term in products. The Hessian of Σ φ(E_c) over the cells is Σ φ' H_c + φ'' g_c g_cᵀ, with H_c and
// g_c of each cell. The first sum is what the products compute; these kernels add the second.
#if defined(VARIMESH_DEVICE_NORM_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_NORM_INL_H
#undef VARIMESH_DEVICE_NORM_INL_H
#else
#define VARIMESH_DEVICE_NORM_INL_H
#endif

#include "core/device_kernels/kernels/arguments.h"
#include "core/energy/number-inl.h"
#include "core/kernels/hessian/batch.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// Where the numbers of a thread are: one thread for each node of each cell, the lane innermost.
struct NodeOfCell {
  std::int64_t batch;
  int lane;
  HWY_INLINE NodeOfCell(const device::NormArguments& a, std::int64_t thread)
      : batch(thread / kBatch / a.nodes), lane(static_cast<int>(thread % kBatch)) {}
};

/// Keeps √φ'' g of a node of a cell, after the gradient.
template <int d>
HWY_INLINE void keep_cell_gradient(const device::NormArguments& a, std::int64_t thread) {
  const NodeOfCell node(a, thread);
  if (node.batch >= a.batches) return;
  const double factor = a.factor[node.batch * kBatch + node.lane];
  for (int k = 0; k < d; ++k)
    a.gradients[thread * d + k] =
        static_cast<float>(factor * static_cast<double>(a.contributions[thread * (2 * d) + k]));
}

/// √φ'' g · direction of a cell.
template <int d>
HWY_INLINE void along_cell_gradient(const device::NormArguments& a, std::int64_t thread) {
  const std::int64_t batch = thread / kBatch, lane = thread % kBatch;
  if (batch >= a.batches) return;
  float along = 0;
  for (int n = 0; n < a.nodes; ++n) {
    const std::int64_t place = (batch * a.nodes + n) * kBatch + lane;
    const float* direction = a.direction + static_cast<std::int64_t>(a.ranks[place]) * d;
    for (int k = 0; k < d; ++k) along = __builtin_fmaf(a.gradients[place * d + k], direction[k], along);
  }
  a.along[thread] = along;
}

/// Adds the term to the contribution of a cell to the product at a node.
template <int d>
HWY_INLINE void add_norm_term(const device::NormArguments& a, std::int64_t thread) {
  const NodeOfCell node(a, thread);
  if (node.batch >= a.batches) return;
  const float along = a.along[node.batch * kBatch + node.lane];
  for (int k = 0; k < d; ++k) {
    float& one = a.contributions[thread * d + k];
    one = __builtin_fmaf(along, a.gradients[thread * d + k], one);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
