// What the kernels of an energy do in one cell, in double precision: energy, gradient, and what products need.
//
// With F = L G A⁻¹ and G = Σ x_n ⊗ ∇_ξ φ_n, a cell's contribution to the gradient at node n is L Σ w P A⁻ᵀ ∇_ξ φ_n,
// with P = dW/dF from core/energy/density-inl.h.
#if defined(VARIMESH_DEVICE_CELLS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_CELLS_INL_H
#undef VARIMESH_DEVICE_CELLS_INL_H
#else
#define VARIMESH_DEVICE_CELLS_INL_H
#endif

#include <limits>

#include "core/device_kernels/kernels/arguments.h"
#include "core/device_kernels/kernels/columns-inl.h"
#include "core/device_kernels/kernels/points-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// One cell, split into `parts`. Simplices have one target each, all other cells one at each point.
template <class E, CellKind kind, int parts>
class CellOnDevice {
  using Arguments = device::CellArguments;
  static constexpr int d = kind.dimension, kHereNow = kHere<parts>;
  static constexpr bool kOneTarget = !kind.is_layered();

 public:
  using Cells = Columns<double, kind, parts>;

  /// @param table  CellArguments::tables.derivatives, or a copy
  HWY_INLINE CellOnDevice(const Arguments& arguments, const double* table, Place<parts> place)
      : a_(arguments), place_(place), energy_(arguments.material), columns_(arguments.tables, table, place.first) {
    columns_.begin(position());
    delta_squared_ = of_cell(a_.delta_squared, 1, 0);
  }

  /// Writes the cell's scan.
  HWY_INLINE void scan() {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    double energy[kHereNow], smallest[kHereNow], least[kHereNow], most[kHereNow];
    for (int p = 0; p < kHereNow; ++p) {
      energy[p] = 0;
      smallest[p] = least[p] = kInfinity;
      most[p] = -kInfinity;
    }
    for_points([&](const Point& at, const Matrix<Real, d>& F) __attribute__((always_inline)) {
      const double J = determinant<d>(F).value, volume = measure_at(at.slot);
      const double W = density_value<d>(energy_, F, Real{delta_squared_}).value;
      if (!at.counts) return;
      energy[at.p] = __builtin_fma(a_.weights[at.slot] * volume, W, energy[at.p]);
      smallest[at.p] = J < smallest[at.p] ? J : smallest[at.p];
      least[at.p] = J * volume < least[at.p] ? J * volume : least[at.p];
      most[at.p] = J * volume > most[at.p] ? J * volume : most[at.p];
    });
    over_parts<parts>(energy, Sum());
    over_parts<parts>(smallest, Smaller());
    over_parts<parts>(least, Smaller());
    over_parts<parts>(most, Greater());
    if (place_.first != 0) return;
    double* to = a_.scans + static_cast<std::int64_t>(place_.batch) * 3 * kBatch + place_.lane;
    to[0] = energy[0];
    to[kBatch] = smallest[0];
    to[2 * kBatch] = scaled_jacobian(least[0], most[0]);
  }

  /// Writes the contributions to the gradient, and with `keeps` what products need.
  template <bool keeps>
  HWY_INLINE void gradient() {
    float middle[d * d], step = 1;
    if constexpr (keeps) keep_range(middle, step);
    const double slope = of_cell(a_.slope, 1, 0);
    columns_.clear();
    VARIMESH_NOT_UNROLLED
    for (int height = 0; height < columns_.heights(); ++height) {
      columns_.raise(height, position());
      columns_.begin_sums();
      VARIMESH_NOT_UNROLLED
      for (int group = 0; group < columns_.groups(); ++group) {
        double own[kHereNow][d * d] = {};
        columns_.derive(group, own);
        forget_loads();
        for (int p = 0; p < kHereNow; ++p) {
          const Point at = point(height, group, p);
          double inverse[d * d];
          const Matrix<Real, d> F = deformation(at.slot, own[p], inverse);
          float* kept = nullptr;
          if (keeps && at.counts) {
            write_steps<d>(F, middle, step, a_.deformation + at_slot(at.slot, d * d));
            kept = a_.linearisation + at_slot(at.slot, KeptPartials<E>::kEntries);
          }
          const Real w = Real{slope} * (Real{a_.weights[at.slot]} * Real{measure_at(at.slot)});
          stress_at<keeps, d>(energy_, F, w, Real{delta_squared_}, inverse, kept, own[p]);
          VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { own[p][i] = at.counts ? own[p][i] : 0.0; }
        }
        columns_.add(group, own);
      }
      columns_.lower(height);
    }
    columns_.for_nodes([&](int node, const double(&sum)[d]) __attribute__((always_inline)) {
      write_gradient<d>(
          sum, left_factor(),
          a_.contributions +
              ((static_cast<std::int64_t>(place_.batch) * kind.nodes() + node) * kBatch + place_.lane) * (2 * d));
    });
  }

 private:
  struct Sum {
    HWY_INLINE double operator()(double a, double b) const { return a + b; }
  };
  struct Smaller {
    HWY_INLINE double operator()(double a, double b) const { return b < a ? b : a; }
  };
  struct Greater {
    HWY_INLINE double operator()(double a, double b) const { return b > a ? b : a; }
  };
  /// The point that a part has in a group.
  struct Point {
    int p, slot;
    bool counts;  ///< False: it has none, and the slot is another's.
  };
  HWY_INLINE Point point(int height, int group, int p) const {
    return {p, columns_.slot(height, group, p), columns_.has_point(group, p)};
  }
  /// Calls use(point, F) for all points.
  template <class Use>
  HWY_INLINE void for_points(const Use& use) {
    VARIMESH_NOT_UNROLLED
    for (int height = 0; height < columns_.heights(); ++height) {
      columns_.raise(height, position());
      VARIMESH_NOT_UNROLLED
      for (int group = 0; group < columns_.groups(); ++group) {
        double own[kHereNow][d * d] = {};
        columns_.derive(group, own);
        forget_loads();
        for (int p = 0; p < kHereNow; ++p) {
          const Point at = point(height, group, p);
          double inverse[d * d];
          const Matrix<Real, d> F = deformation(at.slot, own[p], inverse);
          use(at, F);
        }
      }
    }
  }

  struct Position {
    const Arguments& a;
    const Place<parts>& place;
    HWY_INLINE void operator()(int node, double (&x)[d]) const {
      const auto number = static_cast<std::int64_t>(
          a.cell_nodes[(static_cast<std::int64_t>(place.batch) * kind.nodes() + node) * kBatch + place.lane]);
      VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { x[i] = a.positions[number * d + i]; }
    }
  };
  HWY_INLINE Position position() const { return {a_, place_}; }

  HWY_INLINE double of_cell(const double* numbers, int size, int i) const {
    return numbers[(static_cast<std::int64_t>(place_.batch) * size + i) * kBatch + place_.lane];
  }
  /// Of an array with an entry of `size` numbers per cell if the targets are constant in each, else per point.
  HWY_INLINE const double* of_target(const double* numbers, int slot, int size) const {
    const bool is_one = kOneTarget || a_.affine;
    const std::int64_t entry = static_cast<std::int64_t>(place_.batch) * (is_one ? 1 : a_.points) + (is_one ? 0 : slot);
    return numbers + entry * size * kBatch + place_.lane;
  }
  HWY_INLINE void load_inverse(int slot, double (&inverse)[d * d]) const {
    const double* from = of_target(a_.inverse_target, slot, d * d);
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { inverse[i] = from[i * kBatch]; }
  }
  HWY_INLINE double measure_at(int slot) const { return *of_target(a_.measure, slot, 1); }
  HWY_INLINE const double* left_factor() const {
    return a_.left_factor == nullptr
               ? nullptr
               : a_.left_factor + static_cast<std::int64_t>(place_.batch) * d * d * kBatch + place_.lane;
  }
  /// F at a point, and A⁻¹.
  HWY_INLINE Matrix<Real, d> deformation(int slot, const double (&G)[d * d], double (&inverse)[d * d]) const {
    load_inverse(slot, inverse);
    return deformation_at<d>(G, inverse, left_factor());
  }
  /// Where the numbers of a point begin in an array of `size` numbers per point.
  HWY_INLINE std::int64_t at_slot(int slot, int size) const {
    return (static_cast<std::int64_t>(place_.batch) * a_.points + slot) * size * kBatch + place_.lane;
  }

  /// Keeps the mean of F and the step of its differences from it. The largest difference is that of the largest or of
  /// the smallest entry, because rounding keeps the order.
  HWY_INLINE void keep_range(float (&middle)[d * d], float& step) {
    double sum[d * d][kHereNow], least[d * d][kHereNow], most[d * d][kHereNow];
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) {
      for (int p = 0; p < kHereNow; ++p) {
        sum[i][p] = 0;
        least[i][p] = std::numeric_limits<double>::infinity();
        most[i][p] = -least[i][p];
      }
    }
    for_points([&](const Point& at, const Matrix<Real, d>& F) __attribute__((always_inline)) {
      VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) {
        const double entry = F[i / d][i % d].value;
        sum[i][at.p] = at.counts ? sum[i][at.p] + entry : sum[i][at.p];
        least[i][at.p] = at.counts && entry < least[i][at.p] ? entry : least[i][at.p];
        most[i][at.p] = at.counts && entry > most[i][at.p] ? entry : most[i][at.p];
      }
    });
    double largest = 0;
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) {
      over_parts<parts>(sum[i], Sum());
      over_parts<parts>(least[i], Smaller());
      over_parts<parts>(most[i], Greater());
      middle[i] = static_cast<float>(sum[i][0] / a_.points);
      const auto mean = static_cast<double>(middle[i]);
      const double above = most[i][0] - mean, below = mean - least[i][0];
      largest = above > largest ? above : largest;
      largest = below > largest ? below : largest;
    }
    step = step_of(largest);
    if (place_.first != 0) return;
    float* to = a_.mean + static_cast<std::int64_t>(place_.batch) * (d * d + 1) * kBatch + place_.lane;
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { to[i * kBatch] = middle[i]; }
    to[d * d * kBatch] = step;
  }

  const Arguments& a_;
  const Place<parts> place_;
  const E energy_;
  Cells columns_;
  double delta_squared_;
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
