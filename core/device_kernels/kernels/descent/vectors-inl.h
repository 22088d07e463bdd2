// Vectors of the descent over the free nodes, in double precision: each function is one thread, for one number or one
// node. Those that Newton's method on the energy has too are in kernels/vectors-inl.h.
#if defined(VARIMESH_DEVICE_DESCENT_VECTORS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_DESCENT_VECTORS_INL_H
#undef VARIMESH_DEVICE_DESCENT_VECTORS_INL_H
#else
#define VARIMESH_DEVICE_DESCENT_VECTORS_INL_H
#endif

#include "core/device_kernels/kernels/descent/form-inl.h"
#include "core/device_kernels/kernels/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {
namespace descent {

using device::LossArguments;

// ===== The objective and its derivatives =====

/// q ← the form's gradient
template <int d>
HWY_INLINE void add_up_gradient_of_form(const LossArguments& a, std::int64_t node) {
  if (node >= a.count) return;
  double sum[d];
  sum_of_places<d>(a.own, node, sum);
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.product[node * d + k] = sum[k]; }
}

/// g ← g + q + what holds the node, r ← −g
template <int d>
HWY_INLINE void add_form(const LossArguments& a, std::int64_t node) {
  if (node >= a.count) return;
  const double twice = 2 * a.hold[node];
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    const std::int64_t i = node * d + k;
    const double moved = a.positions[static_cast<std::int64_t>(a.free[node]) * d + k] - a.held_at[i];
    a.gradient[i] = a.gradient[i] + __builtin_fma(twice, moved, a.product[i]);
    a.residual[i] = -a.gradient[i];
  }
}

/// What holds a node.
template <int d>
HWY_INLINE double held(const LossArguments& a, std::int64_t node) {
  if (node >= a.count) return 0;
  double square = 0;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    const double moved = a.positions[static_cast<std::int64_t>(a.free[node]) * d + k] - a.held_at[node * d + k];
    square = __builtin_fma(moved, moved, square);
  }
  return a.hold[node] * square;
}

/// r ← −g, x ← 0
HWY_INLINE void begin_system(const LossArguments& a, std::int64_t i) {
  if (i >= a.count) return;
  a.residual[i] = -a.gradient[i];
  a.step[i] = 0;
}

// ===== Conjugate gradients =====

/// p in single precision
HWY_INLINE void round_direction(const LossArguments& a, std::int64_t i) {
  if (i < a.count) a.rough_direction[i] = static_cast<float>(a.direction[i]);
}

/// q ← H p, from what the cells have made of p: the form, the factor times the energy, and what holds the node. Returns
/// its part of p · q.
template <int d>
HWY_INLINE double add_up_product(const LossArguments& a, std::int64_t node) {
  if (node >= a.count) return 0;
  const double twice = 2 * a.hold[node];
  double sum[d], along = 0;
  sum_of_places<d>(a.own, node, sum);
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    const double p = a.direction[node * d + k], rough = static_cast<double>(a.rough_product[node * d + k]);
    sum[k] = sum[k] + __builtin_fma(a.factor, rough, twice * p);
    a.product[node * d + k] = sum[k];
    along = __builtin_fma(p, sum[k], along);
  }
  return along;
}

/// r ← r − p
HWY_INLINE void subtract_kept(const LossArguments& a, std::int64_t i) {
  if (i < a.count) a.residual[i] = a.residual[i] - a.direction[i];
}

using ::varimesh::HWY_NAMESPACE::add_parts;
using ::varimesh::HWY_NAMESPACE::advance;
using ::varimesh::HWY_NAMESPACE::along_step;
using ::varimesh::HWY_NAMESPACE::keep_residual;
using ::varimesh::HWY_NAMESPACE::keep_start;
using ::varimesh::HWY_NAMESPACE::largest_part;
using ::varimesh::HWY_NAMESPACE::place;
using ::varimesh::HWY_NAMESPACE::size_of_product;
using ::varimesh::HWY_NAMESPACE::size_of_step;
using ::varimesh::HWY_NAMESPACE::square_of_gradient;
using ::varimesh::HWY_NAMESPACE::take_direction;
using ::varimesh::HWY_NAMESPACE::turn;

}  // namespace descent
}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
