// What a visit to a node computes at the quadrature points of a cell, one per vector lane, and what it keeps of that
// for the line search.
#if defined(VARIMESH_KERNELS_LINE_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_KERNELS_LINE_LANES_INL_H
#undef VARIMESH_KERNELS_LINE_LANES_INL_H
#else
#define VARIMESH_KERNELS_LINE_LANES_INL_H
#endif

#include "core/kernels/deformation_lanes-inl.h"
#include "core/kernels/kernels.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// g = A⁻ᵀ ∇_ξ φ at the points from q on.
template <int d, bool affine>
HWY_INLINE void node_gradient(const StarCell& cell, int q, Lanes* g) {
  unrolled<d>([&](auto k) {
    g[k] = zero();
    unrolled<d>([&](auto m) {
      const Lanes entry = affine ? hn::Set(Tag(), cell.inverse_target[m * d + k])
                                 : load(cell.inverse_target + (m * d + k) * cell.stride + q);
      g[k] = hn::MulAdd(load(cell.derivatives + m * cell.stride + q), entry, g[k]);
    });
  });
}

template <bool affine>
HWY_INLINE Lanes weight(const StarCell& cell, int q) {
  if constexpr (affine) return load(cell.weights + q) * hn::Set(Tag(), cell.measure[0]);
  return load(cell.measure + q);
}

/// The sums of StarExpansion, one point per lane.
template <int d>
struct Sums {
  Lanes energy, measure, gradient[d], hessian[d * (d + 1) / 2];
  HWY_INLINE Sums() : energy(zero()), measure(zero()) {
    unrolled<d>([&](auto i) { gradient[i] = zero(); });
    unrolled<d*(d + 1) / 2>([&](auto i) { hessian[i] = zero(); });
  }
};

/// What is kept of an expansion for the line search. At every point J and Q = |F|² are polynomials of the node's
/// displacement a: J + a·c and Q + 2 a·y + |a|² |g|². Layout: kSize vectors per group of points.
template <int d>
struct Line {
  static constexpr int kJ = 0, kQ = 1, kGG = 2, kC = 3, kY = kC + d, kG = kY + d, kSize = kG + d;

  static HWY_INLINE double* at(const StarCell& cell, int q, int entry) {
    return cell.line + q * kSize + entry * static_cast<int>(hn::Lanes(Tag()));
  }

  static HWY_INLINE void keep(const StarCell& cell, int q, Lanes J, Lanes Q, Lanes gg, const Lanes* c, const Lanes* y,
                              const Lanes* g) {
    hn::Store(J, Tag(), at(cell, q, kJ));
    hn::Store(Q, Tag(), at(cell, q, kQ));
    hn::Store(gg, Tag(), at(cell, q, kGG));
    unrolled<d>([&](auto i) {
      hn::Store(c[i], Tag(), at(cell, q, kC + i));
      hn::Store(y[i], Tag(), at(cell, q, kY + i));
      hn::Store(g[i], Tag(), at(cell, q, kG + i));
    });
  }

  /// J and Q with the node displaced by a; `aa` is |a|².
  static HWY_INLINE void after(const StarCell& cell, int q, const Lanes* a, Lanes aa, Lanes& J, Lanes& Q) {
    Lanes along = zero();
    J = load(at(cell, q, kJ));
    unrolled<d>([&](auto i) {
      J = hn::MulAdd(a[i], load(at(cell, q, kC + i)), J);
      along = hn::MulAdd(a[i], load(at(cell, q, kY + i)), along);
    });
    Q = hn::MulAdd(aa, load(at(cell, q, kGG)), load(at(cell, q, kQ))) + (along + along);
  }

  static HWY_INLINE void gradient(const StarCell& cell, int q, Lanes* g) {
    unrolled<d>([&](auto i) { g[i] = load(at(cell, q, kG + i)); });
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
