// The bound on rounding in a certificate: how far the computed Bernstein coefficients of J can be from the exact ones.
// Internal to the library; for numbers and for vectors of them.
//
// With u the unit roundoff and γ_k = k u / (1 − k u) (rounding.h):
//  - The control points of the derivative g_r are a fixed linear map of the nodes. It is evaluated on x − x₀ (one
//    rounding; x₀ is the cell's first node) with tables whose entries come from exact integers. A sum of n products in
//    any order, with or without fused multiply-add, errs by at most γ_n Σ |terms|. So component c of a control point
//    errs by at most E_rc = γ_k K_r M_c. Here M_c is the largest |x − x₀|_c in the cell, K_r the table's largest row
//    sum of absolute values, and k the most roundings on any path.
//  - Let H_rc = max_α |ĝ_rαc| + E_rc, which bounds the exact and the computed control points alike. A Bernstein
//    coefficient of J is a convex combination of determinants of control points (one of each g_r): the product of
//    scaled coefficients is a sum with positive weights that add up to the multinomial by which it is divided. Each
//    determinant is a signed sum over permutations. So each coefficient errs by at most
//        per(E_1, H_2, H_3) + per(H_1, E_2, H_3) + per(H_1, H_2, E_3) + γ_p per(H_1, H_2, H_3),
//    where per is the permanent of the 3×3 matrix with these rows, and p the most roundings on a path through the
//    products. This is one number per cell, not one per coefficient; it follows the cell's own size in each direction.
//  - Coordinates are scaled by a power of two, which is exact, to a mesh of size about one. Nothing overflows then, and
//    an absolute term covers underflow.
//  - A bisection takes means of neighbours, q times over for degree q. It adds q u max |coefficient| (subdivision.cpp).
#if defined(VARIMESH_VALIDITY_ROUNDING_BOUND_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_VALIDITY_ROUNDING_BOUND_INL_H
#undef VARIMESH_VALIDITY_ROUNDING_BOUND_INL_H
#else
#define VARIMESH_VALIDITY_ROUNDING_BOUND_INL_H
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::HWY_NAMESPACE {

/// The permanent of the d × d matrix with rows a, b and (d = 3) c.
template <int d, class Real>
HWY_INLINE Real permanent(const Real* a, const Real* b, const Real* c) {
  if constexpr (d == 2) return a[0] * b[1] + a[1] * b[0];
  return a[0] * (b[1] * c[2] + b[2] * c[1]) + a[1] * (b[0] * c[2] + b[2] * c[0]) + a[2] * (b[0] * c[1] + b[1] * c[0]);
}

/// The bound on the error of every Bernstein coefficient of J. `size` holds the largest computed control points of the
/// derivatives, size[r][c] = max_α |ĝ_rαc|, `error` the bounds E_rc on their errors, and `product_error` is γ_p.
/// `number(x)` makes a Real of a constant.
template <int d, class Real, class Number>
HWY_INLINE Real rounding_bound(const Real (&size)[3][3], const Real (&error)[3][3], Real product_error,
                               const Number& number) {
  Real most[3][3];
  for (int r = 0; r < d; ++r)
    for (int c = 0; c < d; ++c) most[r][c] = size[r][c] * number(1.0001) + error[r][c];
  Real sum = product_error * permanent<d>(most[0], most[1], most[2]) + permanent<d>(error[0], most[1], most[2]) +
             permanent<d>(most[0], error[1], most[2]);
  if constexpr (d == 3) sum = sum + permanent<d>(most[0], most[1], error[2]);
  // A derivative with respect to a barycentric coordinate is twice that with respect to the reference coordinate, hence
  // 2^−d. The other factor covers the rounding in this bound itself, and the last term covers underflow.
  return sum * number(d == 2 ? 0.25 : 0.125) * number(1.000001) + number(1e-290);
}

}  // namespace varimesh::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
