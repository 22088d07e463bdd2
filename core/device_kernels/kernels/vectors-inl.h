// Vectors over the free nodes: each function is one thread, for one number or one node.
#if defined(VARIMESH_DEVICE_VECTORS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_VECTORS_INL_H
#undef VARIMESH_DEVICE_VECTORS_INL_H
#else
#define VARIMESH_DEVICE_VECTORS_INL_H
#endif

#include "core/device_kernels/kernels/solver_arguments.h"
#include "core/device_kernels/kernels/unrolled.h"
#include "core/energy/number-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

using device::VectorArguments;

// ===== Of Newton's method and of the descent: residual, direction and product are floats or doubles =====

/// The numbers of the residual, the direction and the product.
template <class Arguments>
using NumberOf = std::remove_pointer_t<decltype(Arguments::residual)>;

/// x ← x + α p, r ← r − α q
template <class Arguments>
HWY_INLINE void advance(const Arguments& a, std::int64_t i) {
  if (i >= a.count) return;
  a.step[i] = __builtin_fma(a.factor, static_cast<double>(a.direction[i]), a.step[i]);
  a.residual[i] = hwy::HWY_NAMESPACE::fused(-static_cast<NumberOf<Arguments>>(a.factor), a.product[i], a.residual[i]);
}

/// p ← q + β p; p ← q if β is 0
template <class Arguments>
HWY_INLINE void turn(const Arguments& a, std::int64_t i) {
  if (i >= a.count) return;
  const auto beta = static_cast<NumberOf<Arguments>>(a.factor);
  a.direction[i] = beta == 0 ? a.product[i] : hwy::HWY_NAMESPACE::fused(beta, a.direction[i], a.product[i]);
}

/// x ← p
template <class Arguments>
HWY_INLINE void take_direction(const Arguments& a, std::int64_t i) {
  if (i < a.count) a.step[i] = static_cast<double>(a.direction[i]);
}

/// p ← r
template <class Arguments>
HWY_INLINE void keep_residual(const Arguments& a, std::int64_t i) {
  if (i < a.count) a.direction[i] = a.residual[i];
}

/// x ← factor x; its part of g · x
template <class Arguments>
HWY_INLINE double along_step(const Arguments& a, std::int64_t i) {
  if (i >= a.count) return 0;
  a.step[i] = a.factor * a.step[i];
  return a.gradient[i] * a.step[i];
}

template <class Arguments>
HWY_INLINE double square_of_gradient(const Arguments& a, std::int64_t i) {
  return i < a.count ? a.gradient[i] * a.gradient[i] : 0.0;
}

/// The square of a node's displacement, in units of the size of the cells around it.
template <int d, class Arguments, class Number>
HWY_INLINE double relative_square(const Arguments& a, const Number* displacements, std::int64_t node) {
  if (node >= a.count) return 0;
  double square = 0;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    const double one = static_cast<double>(displacements[node * d + k]);
    square = __builtin_fma(one, one, square);
  }
  const double inverse = static_cast<double>(a.inverse_size[node]);
  return square * inverse * inverse;
}
template <int d, class Arguments>
HWY_INLINE double size_of_step(const Arguments& a, std::int64_t node) {
  return relative_square<d>(a, a.step, node);
}
template <int d, class Arguments>
HWY_INLINE double size_of_product(const Arguments& a, std::int64_t node) {
  return relative_square<d>(a, a.product, node);
}

/// Keeps the positions of a free node.
template <int d, class Arguments>
HWY_INLINE void keep_start(const Arguments& a, std::int64_t node) {
  if (node >= a.count) return;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    a.start[node * d + k] = a.positions[static_cast<std::int64_t>(a.free[node]) * d + k];
  }
}

/// Puts a free node to its start plus the factor times the step.
template <int d, class Arguments>
HWY_INLINE void place(const Arguments& a, std::int64_t node) {
  if (node >= a.count) return;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    a.positions[static_cast<std::int64_t>(a.free[node]) * d + k] =
        __builtin_fma(a.factor, a.step[node * d + k], a.start[node * d + k]);
  }
}

// ===== Of Newton's method on the energy =====

/// x ← 0
HWY_INLINE void clear_step(const VectorArguments& a, std::int64_t i) {
  if (i < a.count) a.step[i] = 0;
}

/// r ← −g over the factor, which is a power of two
HWY_INLINE void scale_residual(const VectorArguments& a, std::int64_t i) {
  if (i < a.count) a.residual[i] = static_cast<float>(-a.gradient[i] / a.factor);
}

/// g ← g + factor p
HWY_INLINE void add_residual(const VectorArguments& a, std::int64_t i) {
  if (i < a.count) a.gradient[i] = __builtin_fma(a.factor, static_cast<double>(a.direction[i]), a.gradient[i]);
}

HWY_INLINE double size_of_gradient(const VectorArguments& a, std::int64_t i) {
  return i < a.count ? __builtin_fabs(a.gradient[i]) : 0.0;
}

// ===== Sums =====

/// Joins the parts of a thread: every kThreads-th from its own number on, in one range for each block.
template <class Join>
HWY_INLINE double join_parts(const device::PartsArguments& a, std::int64_t thread, double nothing, const Join& join) {
  constexpr int kThreads = device::kJoinedThreads, kPartsPerThread = device::kPartsPerThread;
  const std::int64_t first = thread / kThreads * kThreads * kPartsPerThread + thread % kThreads;
  double joined = nothing;
  for (int i = 0; i < kPartsPerThread; ++i)
    if (first + i * kThreads < a.count) joined = join(joined, a.from[first + i * kThreads]);
  return joined;
}
struct Add {
  HWY_INLINE double operator()(double a, double b) const { return a + b; }
};
struct Larger {
  HWY_INLINE double operator()(double a, double b) const { return b > a ? b : a; }
};
HWY_INLINE double add_parts(const device::PartsArguments& a, std::int64_t thread) {
  return join_parts(a, thread, 0, Add());
}
HWY_INLINE double largest_part(const device::PartsArguments& a, std::int64_t thread) {
  return join_parts(a, thread, 0, Larger());
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
