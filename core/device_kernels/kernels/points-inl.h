// What the kernels in double precision compute at one quadrature point and at one node of a cell.
#if defined(VARIMESH_DEVICE_POINTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_POINTS_INL_H
#undef VARIMESH_DEVICE_POINTS_INL_H
#else
#define VARIMESH_DEVICE_POINTS_INL_H
#endif

#include <bit>
#include <cstdint>
#include <limits>

#include "core/device_kernels/kernels/unrolled.h"
#include "core/energy/density-inl.h"
#include "core/kernels/hessian/kept_partials-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

using Real = hn::Lane<double>;

/// F = L G A⁻¹. `left_factor`: L of the lane, its entries kBatch apart; null: L = 1.
template <int d>
HWY_INLINE Matrix<Real, d> deformation_at(const double (&G)[d * d], const double (&inverse)[d * d],
                                          const double* left_factor) {
  Matrix<Real, d> F;
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
      double sum = G[i * d] * inverse[j];
      VARIMESH_UNROLLED for (int k = 1; k < d; ++k) { sum = __builtin_fma(G[i * d + k], inverse[k * d + j], sum); }
      F[i][j] = Real{sum};
    }
  }
  if (left_factor == nullptr) return F;
  Matrix<Real, d> turned;
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
      double sum = 0;
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        sum = __builtin_fma(left_factor[(i * d + k) * kBatch], F[k][j].value, sum);
      }
      turned[i][j] = Real{sum};
    }
  }
  return turned;
}

/// w P A⁻ᵀ. With `keeps` and unless `kept` is null, writes the partial derivatives that products need, kBatch apart.
template <bool keeps, int d, class E>
HWY_INLINE void stress_at(const E& energy, const Matrix<Real, d>& F, Real w, Real delta_squared,
                          const double (&inverse)[d * d], float* kept, double (&out)[d * d]) {
  using Kept = KeptPartials<E>;
  const Matrix<Real, d> C = cofactor<d>(F);
  const Real Q = E::kQuadratic == Quadratic::Cofactor ? dot<d>(C, C) : dot<d>(F, F);
  const Partials<Real> f = energy.partials(Q, regularised<E::kFunction>(determinant<d>(F), delta_squared));
  if (keeps && kept != nullptr) {
    const auto keep = [&](int entry, Real value) { kept[entry * kBatch] = static_cast<float>(value.value); };
    keep(Kept::kQ, w * f.f_Q);
    keep(Kept::kJ, w * f.f_J);
    keep(Kept::kJJ, w * f.f_JJ);
    if constexpr (E::kMixed) keep(Kept::kQJ, w * f.f_QJ);
    if constexpr (E::kCurved) keep(Kept::kQQ, w * f.f_QQ);
    if constexpr (E::kStrain != StrainTerm::None) keep(Kept::kW, w);
  }
  const Matrix<Real, d> P = density_gradient<d>(energy, F, C, f);
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
      double sum = 0;
      VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
        sum = __builtin_fma((w * P[i][j]).value, inverse[k * d + j], sum);
      }
      out[i * d + k] = sum;
    }
  }
}

inline constexpr double kLargestStep = std::numeric_limits<std::int16_t>::max();

/// The step of BatchSet::mean for the largest difference from the mean: at least the smallest normal float, to divide
/// by.
HWY_INLINE float step_of(double largest) {
  const float step = static_cast<float>(largest / kLargestStep);
  return step < std::numeric_limits<float>::min() ? std::numeric_limits<float>::min() : step;
}

/// Writes F as BatchSet::deformation has it, kBatch apart.
template <int d>
HWY_INLINE void write_steps(const Matrix<Real, d>& F, const float (&middle)[d * d], float step, std::int16_t* to) {
  VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) {
    double steps = (F[i / d][i % d].value - static_cast<double>(middle[i])) / static_cast<double>(step);
    steps = steps > kLargestStep ? kLargestStep : steps < -kLargestStep ? -kLargestStep : steps;
    to[i * kBatch] = static_cast<std::int16_t>(__builtin_rint(steps));
  }
}

/// Writes L times the sum of a node as two floats per component. `left_factor`: as in deformation_at().
template <int d>
HWY_INLINE void write_gradient(const double (&sum)[d], const double* left_factor, float* to) {
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    double g = sum[i];
    if (left_factor != nullptr) {
      g = 0;
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { g = __builtin_fma(left_factor[(i * d + k) * kBatch], sum[k], g); }
    }
    // The digits that a float has.
    const double high = std::bit_cast<double>(std::bit_cast<std::uint64_t>(g) & ~((std::uint64_t{1} << 29) - 1));
    to[i] = static_cast<float>(high);
    to[d + i] = static_cast<float>(g - high);
  }
}

/// The scaled Jacobian of a cell, CellScan::scaled_jacobian, from the smallest and the largest det ∇χ_M.
HWY_INLINE double scaled_jacobian(double smallest, double largest) {
  const double ratio = smallest / largest;
  return !(largest > 0) || ratio < -1 ? -1.0 : ratio;
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
