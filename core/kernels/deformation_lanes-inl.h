// The deformation gradient at some quadrature points, one per vector lane, and what the sweeps' kernels need of it:
// |F|², J, cofactors, F v and F Fᵀ, as any book on continuum mechanics defines them.
#if defined(VARIMESH_KERNELS_DEFORMATION_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_KERNELS_DEFORMATION_LANES_INL_H
#undef VARIMESH_KERNELS_DEFORMATION_LANES_INL_H
#else
#define VARIMESH_KERNELS_DEFORMATION_LANES_INL_H
#endif

#include "core/base/index.h"
#include "core/energy/number-inl.h"
#include "core/problem/problem.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

using Tag = hn::CappedTag<double, kPointPadding>;
using Lanes = hn::Vec<Tag>;

HWY_INLINE Lanes load(const double* at) { return hn::Load(Tag(), at); }
HWY_INLINE Lanes zero() { return hn::Zero(Tag()); }
HWY_INLINE double sum_of(Lanes v) { return hn::GetLane(hn::SumOfLanes(Tag(), v)); }
HWY_INLINE double min_of(Lanes v) { return hn::GetLane(hn::MinOfLanes(Tag(), v)); }
HWY_INLINE double max_of(Lanes v) { return hn::GetLane(hn::MaxOfLanes(Tag(), v)); }

/// F at some points, one per lane.
template <int d>
struct Gradient {
  Lanes F[d][d];

  HWY_INLINE void load_from(const double* array, int stride, int q) {
    unrolled<d>([&](auto i) { unrolled<d>([&](auto j) { F[i][j] = load(array + (i * d + j) * stride + q); }); });
  }

  /// |F|²
  HWY_INLINE Lanes square() const {
    Lanes sum = zero();
    unrolled<d>([&](auto i) { unrolled<d>([&](auto j) { sum = hn::MulAdd(F[i][j], F[i][j], sum); }); });
    return sum;
  }

  /// Row i of the cofactor matrix.
  HWY_INLINE void cofactor_row(int i, Lanes* C) const {
    if constexpr (d == 2) {
      C[0] = i == 0 ? F[1][1] : zero() - F[0][1];
      C[1] = i == 0 ? zero() - F[1][0] : F[0][0];
    } else {
      const Lanes* a = F[(i + 1) % 3];
      const Lanes* b = F[(i + 2) % 3];
      unrolled<3>([&](auto j) {
        const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        C[j] = hn::MulSub(a[j1], b[j2], a[j2] * b[j1]);
      });
    }
  }

  HWY_INLINE Lanes determinant() const {
    Lanes C[d];
    cofactor_row(0, C);
    Lanes J = F[0][0] * C[0];
    unrolled<d>([&](auto j) {
      if (j > 0) J = hn::MulAdd(F[0][j], C[j], J);
    });
    return J;
  }

  /// F v
  HWY_INLINE void times(const Lanes* v, Lanes* out) const {
    unrolled<d>([&](auto i) {
      out[i] = F[i][0] * v[0];
      unrolled<d>([&](auto j) {
        if (j > 0) out[i] = hn::MulAdd(F[i][j], v[j], out[i]);
      });
    });
  }

  /// F Fᵀ, lower triangle by rows.
  HWY_INLINE void left_product(Lanes* B) const {
    unrolled<d>([&](auto i) {
      unrolled_through(i, [&](auto j) {
        const int entry = lower_index(i, j);
        B[entry] = F[i][0] * F[j][0];
        unrolled<d>([&](auto k) {
          if (k > 0) B[entry] = hn::MulAdd(F[i][k], F[j][k], B[entry]);
        });
      });
    });
  }
};

template <int d>
HWY_INLINE Lanes inner(const Lanes* a, const Lanes* b) {
  Lanes sum = a[0] * b[0];
  unrolled<d>([&](auto i) {
    if (i > 0) sum = hn::MulAdd(a[i], b[i], sum);
  });
  return sum;
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
