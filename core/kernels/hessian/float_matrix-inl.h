// Small matrices in single precision, one cell per lane.
#if defined(VARIMESH_HESSIAN_FLOAT_MATRIX_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_FLOAT_MATRIX_INL_H
#undef VARIMESH_HESSIAN_FLOAT_MATRIX_INL_H
#else
#define VARIMESH_HESSIAN_FLOAT_MATRIX_INL_H
#endif

#include "core/energy/number-inl.h"
#include "core/kernels/hessian/batch.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

using FloatTag = hn::CappedTag<float, kBatch>;
using Floats = hn::Vec<FloatTag>;

HWY_INLINE Floats load(const float* at) { return hn::Load(FloatTag(), at); }
/// `value` in every lane.
HWY_INLINE Floats every(float value) { return hn::Set(FloatTag(), value); }

/// One d × d matrix per lane.
template <int d>
struct FloatMatrix {
  Floats at[d][d];

  HWY_INLINE void load_from(const float* entries) {
    unrolled<d>([&](auto i) { unrolled<d>([&](auto j) { at[i][j] = load(entries + (i * d + j) * kBatch); }); });
  }
  /// this · B, or this · Bᵀ
  template <bool transposed>
  HWY_INLINE FloatMatrix times(const FloatMatrix& B) const {
    FloatMatrix out;
    unrolled<d>([&](auto i) {
      unrolled<d>([&](auto j) {
        Floats sum = at[i][0] * (transposed ? B.at[j][0] : B.at[0][j]);
        unrolled<d>([&](auto k) {
          if (k > 0) sum = hn::MulAdd(at[i][k], transposed ? B.at[j][k] : B.at[k][j], sum);
        });
        out.at[i][j] = sum;
      });
    });
    return out;
  }
  /// thisᵀ · B
  HWY_INLINE FloatMatrix transposed_times(const FloatMatrix& B) const {
    FloatMatrix out;
    unrolled<d>([&](auto i) {
      unrolled<d>([&](auto j) {
        Floats sum = at[0][i] * B.at[0][j];
        unrolled<d>([&](auto k) {
          if (k > 0) sum = hn::MulAdd(at[k][i], B.at[k][j], sum);
        });
        out.at[i][j] = sum;
      });
    });
    return out;
  }
  HWY_INLINE Floats inner(const FloatMatrix& B) const {
    Floats sum = at[0][0] * B.at[0][0];
    unrolled<d>([&](auto i) {
      unrolled<d>([&](auto j) {
        if (i + j > 0) sum = hn::MulAdd(at[i][j], B.at[i][j], sum);
      });
    });
    return sum;
  }
  /// this += s B
  HWY_INLINE void add(Floats s, const FloatMatrix& B) {
    unrolled<d>([&](auto i) { unrolled<d>([&](auto j) { at[i][j] = hn::MulAdd(s, B.at[i][j], at[i][j]); }); });
  }
  HWY_INLINE void scale(Floats s) {
    unrolled<d * d>([&](auto i) { at[i / d][i % d] = at[i / d][i % d] * s; });
  }
};

/// a × b. This and the next are functions of their own because compilers do not inline a lambda of this size.
HWY_INLINE void cross(const Floats* a, const Floats* b, Floats* out) {
  unrolled<3>([&](auto j) {
    const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
    out[j] = hn::MulSub(a[j1], b[j2], a[j2] * b[j1]);
  });
}

/// A row of the derivative of cof F: da × b + a × db.
HWY_INLINE void cross_change(const Floats* a, const Floats* b, const Floats* da, const Floats* db, Floats* out) {
  unrolled<3>([&](auto j) {
    const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
    const Floats first = hn::MulSub(da[j1], b[j2], da[j2] * b[j1]);
    out[j] = hn::MulAdd(a[j1], db[j2], hn::NegMulAdd(a[j2], db[j1], first));
  });
}

/// The derivative of cof F along dF: in 2-D cof dF, in 3-D the mixed products of the rows.
template <int d>
HWY_INLINE FloatMatrix<d> cofactor_change(const FloatMatrix<d>& F, const FloatMatrix<d>& dF) {
  FloatMatrix<d> out;
  if constexpr (d == 2) {
    const Floats none = hn::Zero(FloatTag());
    out.at[0][0] = dF.at[1][1];
    out.at[0][1] = none - dF.at[1][0];
    out.at[1][0] = none - dF.at[0][1];
    out.at[1][1] = dF.at[0][0];
  } else {
    cross_change(F.at[1], F.at[2], dF.at[1], dF.at[2], out.at[0]);
    cross_change(F.at[2], F.at[0], dF.at[2], dF.at[0], out.at[1]);
    cross_change(F.at[0], F.at[1], dF.at[0], dF.at[1], out.at[2]);
  }
  return out;
}

template <int d>
HWY_INLINE FloatMatrix<d> cofactor_of(const FloatMatrix<d>& F) {
  if constexpr (d == 2) return cofactor_change<2>(F, F);  // linear in 2-D
  FloatMatrix<d> out;
  if constexpr (d == 3) {
    cross(F.at[1], F.at[2], out.at[0]);
    cross(F.at[2], F.at[0], out.at[1]);
    cross(F.at[0], F.at[1], out.at[2]);
  }
  return out;
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
