// The blocks of the free nodes on the diagonal of the Hessian, and their inverses.
#if defined(VARIMESH_DEVICE_BLOCKS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_BLOCKS_INL_H
#undef VARIMESH_DEVICE_BLOCKS_INL_H
#else
#define VARIMESH_DEVICE_BLOCKS_INL_H
#endif

#include "core/base/index.h"
#include "core/device_kernels/kernels/solver_arguments.h"
#include "core/device_kernels/kernels/unrolled.h"
#include "core/energy/number-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// A symmetric d × d matrix.
template <int d>
struct Symmetric {
  double at[d][d];

  /// √ Σ of the squares of the entries
  HWY_INLINE double norm() const {
    double square = 0;
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      VARIMESH_UNROLLED for (int j = 0; j < d; ++j) { square = __builtin_fma(at[i][j], at[i][j], square); }
    }
    return __builtin_sqrt(square);
  }
};

/// L⁻¹ of A = L Lᵀ, lower triangle; false if A is not positive definite.
template <int d>
HWY_INLINE bool inverse_of_factor(const double (&A)[d][d], double (&inverse)[d][d]) {
  double L[d][d];
  bool is_positive = true;
  VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      if (i < j) continue;
      double sum = A[i][j];
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        if (k < j) sum = __builtin_fma(-L[i][k], L[j][k], sum);
      }
      if (i == j) is_positive = is_positive && sum > 0;
      L[i][j] = i == j ? __builtin_sqrt(sum) : sum / L[j][j];
    }
  }
  VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      if (i < j) {
        inverse[i][j] = 0;
        continue;
      }
      double sum = i == j ? 1.0 : 0.0;
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        if (k >= j && k < i) sum = __builtin_fma(-L[i][k], inverse[k][j], sum);
      }
      inverse[i][j] = sum / L[i][i];
    }
  }
  return is_positive;
}

/// Rotates the p-th and the q-th axis of A so that its entry (p, q) becomes 0, and the columns of V with them
/// (C. G. J. Jacobi's method; G. H. Golub, C. F. Van Loan, Matrix Computations, 4th edition, 2013, section 8.5).
template <int d, int p, int q>
HWY_INLINE void rotate(Symmetric<d>& A, double (&V)[d][d]) {
  const double off = A.at[p][q];
  if (off == 0) return;
  const double tau = (A.at[q][q] - A.at[p][p]) / (2 * off);
  const double root = __builtin_sqrt(__builtin_fma(tau, tau, 1.0));
  const double t = tau >= 0 ? 1 / (tau + root) : -1 / (root - tau);
  const double c = 1 / __builtin_sqrt(__builtin_fma(t, t, 1.0)), s = t * c;
  A.at[p][p] = A.at[p][p] - t * off;
  A.at[q][q] = A.at[q][q] + t * off;
  A.at[p][q] = A.at[q][p] = 0;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    const double vp = V[k][p], vq = V[k][q];
    V[k][p] = c * vp - s * vq;
    V[k][q] = s * vp + c * vq;
    if (k == p || k == q) continue;
    const double ap = A.at[k][p], aq = A.at[k][q];
    A.at[k][p] = A.at[p][k] = c * ap - s * aq;
    A.at[k][q] = A.at[q][k] = s * ap + c * aq;
  }
}

inline constexpr double kLeastEigenvalue = 1e-3;  // of a block, relative to its largest
inline constexpr double kNothing = 1e-34;         // the inverse of a smaller block may not fit a float
inline constexpr int kJacobiSweeps = 8;

/// The inverse of a block whose eigenvalues are made positive: at least kLeastEigenvalue of the largest, in size.
template <int d>
HWY_INLINE void invert_by_eigenvalues(Symmetric<d> A, Symmetric<d>& out) {
  double V[d][d];
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) { V[i][j] = i == j ? 1 : 0; }
  }
  VARIMESH_NOT_UNROLLED
  for (int sweep = 0; sweep < kJacobiSweeps; ++sweep) {
    rotate<d, 0, 1>(A, V);
    if constexpr (d == 3) {
      rotate<d, 0, 2>(A, V);
      rotate<d, 1, 2>(A, V);
    }
  }
  double largest = 0, size[d];
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    size[k] = __builtin_fabs(A.at[k][k]);
    largest = size[k] > largest ? size[k] : largest;
  }
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    size[k] = 1 / (size[k] > kLeastEigenvalue * largest ? size[k] : kLeastEigenvalue * largest);
  }
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
      double sum = 0;
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum = __builtin_fma(V[i][k] * size[k], V[j][k], sum); }
      out.at[i][j] = sum;
    }
  }
}

/// The block of a node: the sum over its cells, and the inverse of it as Preconditioner has it.
template <int d>
HWY_INLINE void invert_block(const device::BlockArguments& a, std::int64_t node) {
  constexpr int kSides = triangle_size(d);
  if (node >= a.nodes) return;
  double triangle[kSides] = {};
  for (std::int64_t i = a.offsets[node]; i < a.offsets[node + 1]; ++i) {
    const float* from = a.contributions + a.places[i] * kSides;
    VARIMESH_UNROLLED for (int entry = 0; entry < kSides; ++entry) {
      triangle[entry] = triangle[entry] + static_cast<double>(from[entry]);
    }
  }
  Symmetric<d> H, out;
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) { H.at[i][j] = triangle[symmetric_index(i, j)]; }
  }
  const double size = H.norm();
  double factor[d][d];
  const bool is_positive = inverse_of_factor<d>(H.at, factor);
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
      double sum = 0;
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum = __builtin_fma(factor[k][i], factor[k][j], sum); }
      out.at[i][j] = sum;
    }
  }
  // |H| |H⁻¹| bounds the ratio of the eigenvalues. If it is small, nothing has to be made positive.
  if (!is_positive || !(size * out.norm() <= 1 / kLeastEigenvalue)) invert_by_eigenvalues<d>(H, out);
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
      if (j <= i)
        a.inverse[node * kSides + lower_index(i, j)] = size >= kNothing ? static_cast<float>(out.at[i][j]) : 0.0F;
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
