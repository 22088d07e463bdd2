// The change dP of the stress P = dW/dF along a change dF of the deformation gradient, one cell per lane, in single
// precision. With f(Q, J') of the energy, Q = |F|² and C = cof F:
//     dP = 2 f_Q dF + 4 f_QQ (F:dF) F + 2 f_QJ [(C:dF) F + (F:dF) C] + f_JJ (C:dF) C + f_J dC.
#if defined(VARIMESH_HESSIAN_STRESS_CHANGE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_STRESS_CHANGE_INL_H
#undef VARIMESH_HESSIAN_STRESS_CHANGE_INL_H
#else
#define VARIMESH_HESSIAN_STRESS_CHANGE_INL_H
#endif

#include "core/energy/jacobian-inl.h"
#include "core/kernels/hessian/float_matrix-inl.h"
#include "core/kernels/hessian/kept_partials-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// Adds w 2μ (dF E + F dE), E = (FᵀF − 1)/2, dE = sym(Fᵀ dF).
template <int d, class E>
HWY_INLINE void add_green_lagrange(const E& energy, Floats w, const FloatMatrix<d>& F, const FloatMatrix<d>& dF,
                                   FloatMatrix<d>& dP) {
  FloatMatrix<d> twice_E = F.transposed_times(F);
  unrolled<d>([&](auto i) { twice_E.at[i][i] = twice_E.at[i][i] - every(1.0F); });
  const FloatMatrix<d> half = F.transposed_times(dF);
  FloatMatrix<d> twice_dE;
  unrolled<d>([&](auto i) { unrolled<d>([&](auto j) { twice_dE.at[i][j] = half.at[i][j] + half.at[j][i]; }); });
  const Floats w_mu = w * every(static_cast<float>(energy.mu));
  dP.add(w_mu, dF.template times<false>(twice_E));
  dP.add(w_mu, F.template times<false>(twice_dE));
}

/// Adds w 2μ sym dF, and w λ tr dF 1 if the energy has the trace of the strain.
template <int d, class E>
HWY_INLINE void add_small_strain(const E& energy, Floats w, const FloatMatrix<d>& dF, FloatMatrix<d>& dP) {
  const Floats w_mu = w * every(static_cast<float>(energy.mu));
  Floats trace = hn::Zero(FloatTag());
  unrolled<d>([&](auto i) {
    trace = trace + dF.at[i][i];
    unrolled<d>([&](auto j) { dP.at[i][j] = hn::MulAdd(w_mu, dF.at[i][j] + dF.at[j][i], dP.at[i][j]); });
  });
  if constexpr (E::kTraceOfStrain) {
    const Floats pressure = w * every(static_cast<float>(energy.lambda)) * trace;
    unrolled<d>([&](auto i) { dP.at[i][i] = dP.at[i][i] + pressure; });
  }
}

/// w dP for a change dF of F. `partials`: as KeptPoints::partials().
template <int d, class E>
HWY_INLINE FloatMatrix<d> stress_change(const E& energy, const FloatMatrix<d>& F, const float* partials,
                                        const FloatMatrix<d>& dF) {
  using Kept = KeptPartials<E>;
  const auto entry = [&](int index) { return load(partials + index * kBatch); };
  const FloatMatrix<d> C = cofactor_of<d>(F);
  const Floats dJ = C.inner(dF), two = every(2.0F);
  FloatMatrix<d> dP = cofactor_change<d>(F, dF);
  dP.scale(entry(Kept::kJ));
  Floats along_C = entry(Kept::kJJ) * dJ;
  if constexpr (E::kQuadratic == Quadratic::Deformation) {
    dP.add(two * entry(Kept::kQ), dF);
    if constexpr (E::kMixed || E::kCurved) {
      const Floats dQ = two * F.inner(dF);
      Floats along_F = hn::Zero(FloatTag());
      if constexpr (E::kMixed) {
        along_F = entry(Kept::kQJ) * dJ;
        along_C = hn::MulAdd(entry(Kept::kQJ), dQ, along_C);
      }
      if constexpr (E::kCurved) along_F = hn::MulAdd(entry(Kept::kQQ), dQ, along_F);
      dP.add(two * along_F, F);
    }
  } else {
    // Q = |C|²: dQ/dF = 2 (|F|² F − F Fᵀ F), and its change along dF.
    const FloatMatrix<d> B = F.template times<true>(F), dB = dF.template times<true>(F);  // F Fᵀ, dF Fᵀ
    const Floats square = F.inner(F), dot = F.inner(dF);
    FloatMatrix<d> slope = B.template times<false>(F);  // F Fᵀ F
    slope.scale(every(-1.0F));
    slope.add(square, F);
    const Floats dQ = two * slope.inner(dF);
    FloatMatrix<d> change = B.template times<false>(dF);
    change.add(every(1.0F), dB.template times<false>(F));
    FloatMatrix<d> dBt;
    unrolled<d>([&](auto i) { unrolled<d>([&](auto j) { dBt.at[i][j] = dB.at[j][i]; }); });
    change.add(every(1.0F), dBt.template times<false>(F));
    change.scale(every(-1.0F));
    change.add(square, dF);
    change.add(two * dot, F);
    dP.add(two * entry(Kept::kQ), change);
    if constexpr (E::kMixed) {
      dP.add(two * entry(Kept::kQJ) * dJ, slope);
      along_C = hn::MulAdd(entry(Kept::kQJ), dQ, along_C);
    }
  }
  dP.add(along_C, C);
  if constexpr (E::kStrain == StrainTerm::GreenLagrange) add_green_lagrange(energy, entry(Kept::kW), F, dF, dP);
  if constexpr (E::kStrain == StrainTerm::Small) add_small_strain(energy, entry(Kept::kW), dF, dP);
  return dP;
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
