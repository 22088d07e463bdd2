// The strain terms of the linear elastic energies at some quadrature points, one per vector lane: μ E:E, with E the
// small strain or the Green-Lagrange strain, and for energies that have it λ/2 (tr E)² of the small strain.
#if defined(VARIMESH_KERNELS_STRAIN_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_KERNELS_STRAIN_LANES_INL_H
#undef VARIMESH_KERNELS_STRAIN_LANES_INL_H
#else
#define VARIMESH_KERNELS_STRAIN_LANES_INL_H
#endif

#include "core/base/index.h"
#include "core/energy/jacobian-inl.h"
#include "core/kernels/line_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// The value of the strain terms. |FᵀF − 1| = |FFᵀ − 1|.
template <int d, class E>
HWY_INLINE Lanes strain_value(const E& energy, const Gradient<d>& at) {
  const Lanes one = hn::Set(Tag(), 1.0);
  Lanes sum = zero();
  if constexpr (E::kStrain == StrainTerm::GreenLagrange) {
    Lanes B[d * (d + 1) / 2];
    at.left_product(B);
    unrolled<d>([&](auto i) {
      unrolled_through(i, [&](auto j) {
        const int entry = lower_index(i, j);
        const Lanes e = i == j ? B[entry] - one : B[entry];
        sum = hn::MulAdd(i == j ? e : e + e, e, sum);
      });
    });
    return hn::Set(Tag(), 0.25 * energy.mu) * sum;
  } else {
    Lanes trace = zero();
    unrolled<d>([&](auto i) {
      const Lanes e = at.F[i][i] - one;
      trace = trace + e;
      sum = hn::MulAdd(e, e, sum);
      unrolled_below(i, [&](auto j) {
        const Lanes shear = at.F[i][j] + at.F[j][i];
        sum = hn::MulAdd(hn::Set(Tag(), 0.5) * shear, shear, sum);
      });
    });
    const Lanes W = hn::Set(Tag(), energy.mu) * sum;
    return E::kTraceOfStrain ? hn::MulAdd(hn::Set(Tag(), 0.5 * energy.lambda) * trace, trace, W) : W;
  }
}

/// Adds μ E:E for E = (FᵀF − 1)/2. With y = F g: gradient 2μ F E g, Hessian μ (|g|² F Fᵀ + y yᵀ) + 2μ (g·E g) 1,
/// where F E g = (F Fᵀ y − y)/2 and g·E g = (|y|² − |g|²)/2.
template <int d, class E>
HWY_INLINE void add_green_lagrange(const E& energy, const Gradient<d>& at, Lanes w, Lanes gg, const Lanes* y,
                                   Sums<d>& sums) {
  const Lanes w_mu = w * hn::Set(Tag(), energy.mu);
  Lanes B[d * (d + 1) / 2];
  at.left_product(B);
  const Lanes shift = inner<d>(y, y) - gg;
  sums.energy = hn::MulAdd(w, strain_value(energy, at), sums.energy);
  unrolled<d>([&](auto i) {
    Lanes By = zero() - y[i];
    unrolled<d>([&](auto m) { By = hn::MulAdd(B[symmetric_index(i, m)], y[m], By); });
    sums.gradient[i] = hn::MulAdd(w_mu, By, sums.gradient[i]);
    unrolled_through(i, [&](auto m) {
      const int entry = lower_index(i, m);
      Lanes h = hn::MulAdd(gg, B[entry], y[i] * y[m]);
      if (i == m) h = h + shift;
      sums.hessian[entry] = hn::MulAdd(w_mu, h, sums.hessian[entry]);
    });
  });
}

/// Adds the terms of E = sym F − 1. μ E:E has the gradient 2μ E g and the Hessian μ (|g|² 1 + g gᵀ); λ/2 (tr E)² has λ
/// tr E g and λ g gᵀ.
template <int d, class E>
HWY_INLINE void add_small_strain(const E& energy, const Gradient<d>& at, Lanes w, const Lanes* g, Lanes gg,
                                 Sums<d>& sums) {
  const Lanes w_mu = w * hn::Set(Tag(), energy.mu);
  Lanes trace = zero(), w_lambda = zero();
  if constexpr (E::kTraceOfStrain) {
    trace = hn::Set(Tag(), -double(d));
    unrolled<d>([&](auto i) { trace = trace + at.F[i][i]; });
    w_lambda = w * hn::Set(Tag(), energy.lambda);
  }
  sums.energy = hn::MulAdd(w, strain_value(energy, at), sums.energy);
  unrolled<d>([&](auto i) {
    Lanes Eg = zero() - (g[i] + g[i]);  // 2 E g
    unrolled<d>([&](auto m) { Eg = hn::MulAdd(at.F[i][m] + at.F[m][i], g[m], Eg); });
    sums.gradient[i] = hn::MulAdd(w_mu, Eg, hn::MulAdd(w_lambda * trace, g[i], sums.gradient[i]));
    unrolled_through(i, [&](auto m) {
      const int entry = lower_index(i, m);
      Lanes h = hn::MulAdd((w_mu + w_lambda) * g[i], g[m], sums.hessian[entry]);
      if (i == m) h = hn::MulAdd(w_mu, gg, h);
      sums.hessian[entry] = h;
    });
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
