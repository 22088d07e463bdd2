// Vectors of the descent over the free nodes, in double precision: each function is one thread, for one number or one
// node.
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

/// x ← x + α p, r ← r − α q
HWY_INLINE void advance(const LossArguments& a, std::int64_t i) {
  if (i >= a.count) return;
  a.step[i] = __builtin_fma(a.factor, a.direction[i], a.step[i]);
  a.residual[i] = __builtin_fma(-a.factor, a.product[i], a.residual[i]);
}

/// p ← q + β p; p ← q if β is 0
HWY_INLINE void turn(const LossArguments& a, std::int64_t i) {
  if (i < a.count)
    a.direction[i] = a.factor == 0 ? a.product[i] : __builtin_fma(a.factor, a.direction[i], a.product[i]);
}

/// x ← p
HWY_INLINE void take_direction(const LossArguments& a, std::int64_t i) {
  if (i < a.count) a.step[i] = a.direction[i];
}

/// p ← r
HWY_INLINE void keep_residual(const LossArguments& a, std::int64_t i) {
  if (i < a.count) a.direction[i] = a.residual[i];
}

/// r ← r − p
HWY_INLINE void subtract_kept(const LossArguments& a, std::int64_t i) {
  if (i < a.count) a.residual[i] = a.residual[i] - a.direction[i];
}

// ===== Sizes and the step =====

HWY_INLINE double square_of_gradient(const LossArguments& a, std::int64_t i) {
  return i < a.count ? a.gradient[i] * a.gradient[i] : 0.0;
}

/// Its part of g · x.
HWY_INLINE double along_step(const LossArguments& a, std::int64_t i) {
  return i < a.count ? a.gradient[i] * a.step[i] : 0.0;
}

/// The square of a node's displacement, in units of the size of the cells around it.
template <int d>
HWY_INLINE double relative_square(const LossArguments& a, const double* displacements, std::int64_t node) {
  if (node >= a.count) return 0;
  double square = 0;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    square = __builtin_fma(displacements[node * d + k], displacements[node * d + k], square);
  }
  const double inverse = static_cast<double>(a.inverse_size[node]);
  return square * inverse * inverse;
}
template <int d>
HWY_INLINE double size_of_step(const LossArguments& a, std::int64_t node) {
  return relative_square<d>(a, a.step, node);
}
template <int d>
HWY_INLINE double size_of_product(const LossArguments& a, std::int64_t node) {
  return relative_square<d>(a, a.product, node);
}

/// Keeps the positions of a free node.
template <int d>
HWY_INLINE void keep_start(const LossArguments& a, std::int64_t node) {
  if (node >= a.count) return;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    a.start[node * d + k] = a.positions[static_cast<std::int64_t>(a.free[node]) * d + k];
  }
}

/// Puts a free node to its start plus the factor times the step.
template <int d>
HWY_INLINE void place(const LossArguments& a, std::int64_t node) {
  if (node >= a.count) return;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    a.positions[static_cast<std::int64_t>(a.free[node]) * d + k] =
        __builtin_fma(a.factor, a.step[node * d + k], a.start[node * d + k]);
  }
}

using ::varimesh::HWY_NAMESPACE::add_parts;
using ::varimesh::HWY_NAMESPACE::largest_part;

}  // namespace descent
}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
