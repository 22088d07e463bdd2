// What rounding does to the Bernstein coefficients of J, for numbers and for vectors of them. Internal to core/quality.
#if defined(VARIMESH_QUALITY_COEFFICIENT_ERROR_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_QUALITY_COEFFICIENT_ERROR_INL_H
#undef VARIMESH_QUALITY_COEFFICIENT_ERROR_INL_H
#else
#define VARIMESH_QUALITY_COEFFICIENT_ERROR_INL_H
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

/// Bound on the error of every Bernstein coefficient of J, from the largest computed control points of the derivatives,
/// size[r][c] = max_α |g_r,α,c|, bounds on their errors, and the relative error of the products. The derivation is in
/// certificate.h. `number`: a constant as a Real.
template <int d, class Real, class Number>
HWY_INLINE Real coefficient_error(const Real (&size)[3][3], const Real (&error)[3][3], Real product_error,
                                  const Number& number) {
  Real most[3][3];
  for (int r = 0; r < d; ++r)
    for (int c = 0; c < d; ++c) most[r][c] = size[r][c] * number(1.0001) + error[r][c];
  Real sum = product_error * permanent<d>(most[0], most[1], most[2]) + permanent<d>(error[0], most[1], most[2]) +
             permanent<d>(most[0], error[1], most[2]);
  if constexpr (d == 3) sum = sum + permanent<d>(most[0], most[1], error[2]);
  // The derivatives are with respect to barycentric coordinates, half those to reference coordinates, squared or cubed.
  // Rounding in this bound itself is covered by the last factor, underflow by the last term: coordinates are of size
  // one.
  return sum * number(d == 2 ? 0.25 : 0.125) * number(1.000001) + number(1e-290);
}

}  // namespace varimesh::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
