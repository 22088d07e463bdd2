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
#include "core/device_kernels/kernels/columns-inl.h"
#include "core/kernels/hessian/kept_points-inl.h"
#include "core/kernels/hessian/stress_change-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// One cell, split into `parts`. Simplices have one target each, all other cells one at each point.
template <class E, CellKind kind, int parts>
class ProductOnDevice {
  using Arguments = device::ProductArguments;
  static constexpr int d = kind.dimension, kHereNow = kHere<parts>;
  static constexpr bool kOneTarget = !kind.is_layered();

 public:
  using Cells = Columns<float, kind, parts>;

  /// @param table  ProductArguments::tables.derivatives, or a copy
  HWY_INLINE ProductOnDevice(const Arguments& arguments, const float* table, Place<parts> place)
      : a_(arguments),
        place_(place),
        energy_(arguments.material),
        kept_(of_batch(a_.linearisation, static_cast<std::int64_t>(a_.points) * KeptPartials<E>::kEntries),
              KeptPartials<E>::kEntries, of_batch(a_.deformation, static_cast<std::int64_t>(a_.points) * d * d),
              of_batch(a_.mean, d * d + 1), place.lane),
        columns_(arguments.tables, table, place.first) {
    columns_.begin(direction());
    if constexpr (kOneTarget) inverse_ = inverse_target(0);
  }

  /// Writes the cell's contributions.
  HWY_INLINE void multiply() {
    columns_.clear();
    VARIMESH_NOT_UNROLLED
    for (int height = 0; height < columns_.heights(); ++height) {
      columns_.raise(height, direction());
      columns_.begin_sums();
      VARIMESH_NOT_UNROLLED
      for (int group = 0; group < columns_.groups(); ++group) {
        float own[kHereNow][d * d] = {};
        columns_.derive(group, own);
        forget_loads();
        for (int p = 0; p < kHereNow; ++p)
          change_stress(columns_.slot(height, group, p), columns_.has_point(group, p), own[p]);
        columns_.add(group, own);
      }
      columns_.lower(height);
    }
    columns_.for_nodes([&](int node, const float(&sum)[d]) __attribute__((always_inline)) {
      float* to = a_.contributions +
                  ((static_cast<std::int64_t>(place_.batch) * kind.nodes() + node) * kBatch + place_.lane) * d;
      float turned[d];
      times_left_factor(sum, turned);
      VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { to[i] = turned[i]; }
    });
  }

 private:
  template <class T>
  HWY_INLINE const T* of_batch(const T* numbers, std::int64_t size) const {
    return numbers + place_.batch * size * kBatch;
  }

  /// Loads L times the direction.
  struct Direction {
    const ProductOnDevice& cell;
    HWY_INLINE void operator()(int node, float (&x)[d]) const {
      const float* from =
          cell.a_.direction +
          static_cast<std::int64_t>(cell.of_batch(cell.a_.ranks, kind.nodes())[node * kBatch + cell.place_.lane]) * d;
      float u[d];
      VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { u[i] = from[i]; }
      cell.times_left_factor(u, x);
    }
  };
  HWY_INLINE Direction direction() const { return {*this}; }

  /// A⁻¹ in single precision.
  HWY_INLINE FloatMatrix<d> inverse_target(int slot) const {
    const bool is_one = kOneTarget || a_.affine;
    const double* from = of_batch(a_.inverse_target, static_cast<std::int64_t>(is_one ? 1 : a_.points) * (d * d)) +
                         (static_cast<std::int64_t>(is_one ? 0 : slot) * (d * d)) * kBatch + place_.lane;
    FloatMatrix<d> inverse;
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) {
      inverse.at[i / d][i % d] = Floats{static_cast<float>(from[i * kBatch])};
    }
    return inverse;
  }

  /// Replaces dG by w dP A⁻ᵀ, or by 0 if it is that of no point.
  HWY_INLINE void change_stress(int slot, bool counts, float (&numbers)[d * d]) const {
    FloatMatrix<d> dG, inverse;
    if constexpr (kOneTarget)
      inverse = inverse_;
    else
      inverse = inverse_target(slot);
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { dG.at[i / d][i % d] = Floats{numbers[i]}; }
    const FloatMatrix<d> out =
        stress_change(energy_, kept_.deformation(slot), kept_.partials(slot), dG.template times<false>(inverse))
            .template times<true>(inverse);
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { numbers[i] = counts ? out.at[i / d][i % d].value : 0.0F; }
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
  const Place<parts> place_;
  const E energy_;
  const KeptPoints<d> kept_;
  Cells columns_;
  FloatMatrix<d> inverse_;
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
