// The product of a cell's Hessian with a direction, in single precision, and sums over the cells of a node.
//
// For a direction u at the nodes, dG = Σ u_n ⊗ ∇_ξ φ_n and dF = dG A⁻¹ at every point. With the change dP of the stress
// along dF (core/kernels/hessian/stress_change-inl.h), the contribution at node n is Σ w dP A⁻ᵀ ∇_ξ φ_n.
#if defined(VARIMESH_DEVICE_PRODUCT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_PRODUCT_INL_H
#undef VARIMESH_DEVICE_PRODUCT_INL_H
#else
#define VARIMESH_DEVICE_PRODUCT_INL_H
#endif

#include "core/device_kernels/kernels/arguments.h"
#include "core/device_kernels/kernels/parts-inl.h"
#include "core/kernels/hessian/kept_points-inl.h"
#include "core/kernels/hessian/stress_change-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// One cell, with its nodes split into `parts`. `table`: ProductArguments::derivatives.
template <class E, int d, int nodes, int parts>
class ProductOnDevice {
  using Arguments = device::ProductArguments;
  static constexpr int kHereNow = kHere<parts>, kTurnsNow = kTurns<parts>;

 public:
  static constexpr int kNodes = (nodes + parts - 1) / parts;
  static constexpr int kRow = parts * d * kNodes;

  HWY_INLINE ProductOnDevice(const Arguments& arguments, const float* table, Place<parts> place)
      : a_(arguments),
        table_(table),
        place_(place),
        energy_(arguments.material),
        kept_(of_batch(a_.linearisation, static_cast<std::int64_t>(a_.points) * KeptPartials<E>::kEntries),
              KeptPartials<E>::kEntries, of_batch(a_.deformation, static_cast<std::int64_t>(a_.points) * d * d),
              of_batch(a_.mean, d * d + 1), place.lane) {
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) {
      inverse_.at[i / d][i % d] =
          Floats{static_cast<float>(of_batch(a_.inverse_target, d * d)[i * kBatch + place_.lane])};
    }
    for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
        const float* from =
            a_.direction + static_cast<std::int64_t>(of_batch(a_.ranks, nodes)[node(p, n) * kBatch + place_.lane]) * d;
        float u[d];
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { u[i] = from[i]; }
        times_left_factor(u, u_[p][n]);
      }
  }

  /// Writes the cell's contributions.
  HWY_INLINE void multiply() {
    float sums[kHereNow][kNodes][d];
    for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { sums[p][n][i] = 0; }
      }
    VARIMESH_NOT_UNROLLED
    for (int first = 0; first < a_.points; first += kTurnsNow) {
      float changes[kHereNow][kTurnsNow][d * d], own[kHereNow][d * d];
      for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int turn = 0; turn < kTurnsNow; ++turn) {
          add_gradient(first + turn, p, changes[p][turn]);
        }
      take_turns<parts>(changes, place_.first, own);
      forget_loads();
      for (int p = 0; p < kHereNow; ++p) change_stress(first + part(p) % kTurnsNow, own[p]);
      VARIMESH_UNROLLED for (int turn = 0; turn < kTurnsNow; ++turn) {
        float stress[d * d];
        share<parts>(own, turn, stress);
        const float* row = table_ + (first + turn) * kRow;
        for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
            VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
              const float derivative = row[(part(p) * d + k) * kNodes + n];
              VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
                sums[p][n][i] = __builtin_fmaf(stress[i * d + k], derivative, sums[p][n][i]);
              }
            }
          }
      }
    }
    for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
        if (part(p) * kNodes + n >= nodes) continue;
        float* to = a_.contributions +
                    ((static_cast<std::int64_t>(place_.batch) * nodes + node(p, n)) * kBatch + place_.lane) * d;
        float turned[d];
        times_left_factor(sums[p][n], turned);
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { to[i] = turned[i]; }
      }
  }

 private:
  HWY_INLINE int part(int p) const { return place_.first + p; }
  /// The last node stands for those that a part lacks; their derivatives are 0.
  HWY_INLINE int node(int p, int n) const { return part(p) * kNodes + n < nodes ? part(p) * kNodes + n : nodes - 1; }
  template <class T>
  HWY_INLINE const T* of_batch(const T* numbers, std::int64_t size) const {
    return numbers + place_.batch * size * kBatch;
  }

  HWY_INLINE void add_gradient(int row, int p, float (&dG)[d * d]) const {
    const float* derivatives = table_ + row * kRow + part(p) * d * kNodes;
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { dG[i] = 0; }
    VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        const float derivative = derivatives[k * kNodes + n];
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
          dG[i * d + k] = __builtin_fmaf(u_[p][n][i], derivative, dG[i * d + k]);
        }
      }
    }
  }

  /// Replaces dG by w dP A⁻ᵀ. In the padding dG is 0, and any point will do.
  HWY_INLINE void change_stress(int point, float (&numbers)[d * d]) const {
    const int slot = point < a_.points ? point : a_.points - 1;
    FloatMatrix<d> dG;
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { dG.at[i / d][i % d] = Floats{numbers[i]}; }
    const FloatMatrix<d> out =
        stress_change(energy_, kept_.deformation(slot), kept_.partials(slot), dG.template times<false>(inverse_))
            .template times<true>(inverse_);
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { numbers[i] = out.at[i / d][i % d].value; }
  }

  /// L is symmetric, so it is right for a direction and for the result.
  HWY_INLINE void times_left_factor(const float (&x)[d], float (&out)[d]) const {
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      out[i] = x[i];
      if (a_.left_factor == nullptr) continue;
      out[i] = 0;
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        const double entry = of_batch(a_.left_factor, d * d)[(i * d + k) * kBatch + place_.lane];
        out[i] = __builtin_fmaf(static_cast<float>(entry), x[k], out[i]);
      }
    }
  }

  const Arguments& a_;
  const float* table_;
  const Place<parts> place_;
  const E energy_;
  const KeptPoints<d> kept_;
  FloatMatrix<d> inverse_;
  float u_[kHereNow][kNodes][d];
};

/// The product of a node: the sum of its cells' contributions in their order. Returns its part of direction · product.
template <int d>
HWY_INLINE double add_up_product(const device::SumArguments& a, std::int64_t node) {
  if (node >= a.nodes) return 0;
  float sum[d] = {};
  for (std::int64_t i = a.offsets[node]; i < a.offsets[node + 1]; ++i) {
    const float* from = a.contributions + a.places[i] * d;
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum[k] = sum[k] + from[k]; }
  }
  double along = 0;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    a.product[node * d + k] = sum[k];
    along = __builtin_fma(static_cast<double>(sum[k]), static_cast<double>(a.direction[node * d + k]), along);
  }
  return along;
}

/// The gradient of a node: the sum of its cells' contributions in their order, times the scale.
template <int d>
HWY_INLINE void add_up_gradient(const device::SumArguments& a, std::int64_t node) {
  if (node >= a.nodes) return;
  double sum[d] = {};
  for (std::int64_t i = a.offsets[node]; i < a.offsets[node + 1]; ++i) {
    const float* from = a.contributions + a.places[i] * (2 * d);
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
      sum[k] = sum[k] + (static_cast<double>(from[k]) + static_cast<double>(from[d + k]));
    }
  }
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.gradient[node * d + k] = sum[k] * a.scale; }
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
