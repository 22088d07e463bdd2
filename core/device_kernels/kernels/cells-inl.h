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
#include "core/device_kernels/kernels/parts-inl.h"
#include "core/device_kernels/kernels/points-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// One cell, with its nodes split into `parts`. `table`: CellArguments::derivatives.
template <class E, int d, int nodes, int parts>
class CellOnDevice {
  using Arguments = device::CellArguments;
  static constexpr int kHereNow = kHere<parts>, kTurnsNow = kTurns<parts>;

 public:
  /// Nodes of a part.
  static constexpr int kNodes = (nodes + parts - 1) / parts;
  /// Numbers of a point in the table.
  static constexpr int kRow = parts * d * kNodes;

  HWY_INLINE CellOnDevice(const Arguments& arguments, const double* table, Place<parts> place)
      : a_(arguments),
        table_(table),
        place_(place),
        energy_(arguments.material),
        groups_((arguments.points + kTurnsNow - 1) / kTurnsNow) {
    for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
        const int node = part(p) * kNodes + n < nodes ? part(p) * kNodes + n : nodes - 1;
        const auto number = static_cast<std::int64_t>(
            a_.nodes[(static_cast<std::int64_t>(place_.batch) * nodes + node) * kBatch + place_.lane]);
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { x_[p][n][i] = a_.positions[number * d + i]; }
      }
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { inverse_[i] = of_cell(a_.inverse_target, d * d, i); }
    measure_ = of_cell(a_.measure, 1, 0);
    delta_squared_ = of_cell(a_.delta_squared, 1, 0);
  }

  /// Writes the cell's scan.
  HWY_INLINE void scan() {
    double energy[kHereNow], smallest[kHereNow], largest[kHereNow];
    for (int p = 0; p < kHereNow; ++p) {
      energy[p] = 0;
      smallest[p] = std::numeric_limits<double>::infinity();
      largest[p] = -smallest[p];
    }
    VARIMESH_NOT_UNROLLED
    for (int group = 0; group < groups_; ++group) {
      double G[kHereNow][d * d];
      gradients(group, G);
      for (int p = 0; p < kHereNow; ++p) {
        const Matrix<Real, d> F = deformation(G[p]);
        const double J = determinant<d>(F).value;
        const double W = density_value<d>(energy_, F, Real{delta_squared_}).value;
        energy[p] = __builtin_fma(weight(group, p) * measure_, W, energy[p]);
        smallest[p] = J < smallest[p] ? J : smallest[p];
        largest[p] = J > largest[p] ? J : largest[p];
      }
    }
    over_parts<parts>(energy, [](double a, double b) { return a + b; });
    over_parts<parts>(smallest, [](double a, double b) { return b < a ? b : a; });
    over_parts<parts>(largest, [](double a, double b) { return b > a ? b : a; });
    if (place_.first != 0) return;
    double* to = a_.scans + static_cast<std::int64_t>(place_.batch) * 3 * kBatch + place_.lane;
    to[0] = energy[0];
    to[kBatch] = smallest[0];
    to[2 * kBatch] = scaled_jacobian(smallest[0], largest[0]);
  }

  /// Writes the contributions to the gradient, and with `keeps` what products need.
  template <bool keeps>
  HWY_INLINE void gradient() {
    float middle[d * d], step = 1;
    if constexpr (keeps) keep_range(middle, step);
    double sums[kHereNow][kNodes][d];
    for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { sums[p][n][i] = 0; }
      }
    const double slope = of_cell(a_.slope, 1, 0);
    VARIMESH_NOT_UNROLLED
    for (int group = 0; group < groups_; ++group) {
      double own[kHereNow][d * d];
      gradients(group, own);
      for (int p = 0; p < kHereNow; ++p) {
        const Matrix<Real, d> F = deformation(own[p]);
        float* kept = nullptr;
        if (keeps && writes(group, p)) {
          write_steps<d>(F, middle, step, a_.deformation + at_point(group, p, d * d));
          kept = a_.linearisation + at_point(group, p, KeptPartials<E>::kEntries);
        }
        const Real w = Real{slope} * (Real{weight_of(group, p)} * Real{measure_});
        stress_at<keeps, d>(energy_, F, w, Real{delta_squared_}, inverse_, kept, own[p]);
      }
      VARIMESH_UNROLLED for (int turn = 0; turn < kTurnsNow; ++turn) {
        double stress_there[d * d];
        share<parts>(own, turn, stress_there);
        const double* rows = table_ + (group * kTurnsNow + turn) * kRow;
        for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
            VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
              const double derivative = rows[(part(p) * d + k) * kNodes + n];
              VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
                sums[p][n][i] = __builtin_fma(stress_there[i * d + k], derivative, sums[p][n][i]);
              }
            }
          }
      }
    }
    for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
        const int node = part(p) * kNodes + n;
        if (node < nodes)
          write_gradient<d>(
              sums[p][n], left_factor(),
              a_.contributions +
                  ((static_cast<std::int64_t>(place_.batch) * nodes + node) * kBatch + place_.lane) * (2 * d));
      }
  }

 private:
  HWY_INLINE int part(int p) const { return place_.first + p; }
  /// The point that a part has in a group.
  HWY_INLINE int point(int group, int p) const { return group * kTurnsNow + part(p) % kTurnsNow; }
  HWY_INLINE double weight_of(int group, int p) const { return a_.weights[point(group, p)]; }
  /// The same for sums over all parts: 0 for those that repeat what others do.
  HWY_INLINE double weight(int group, int p) const { return part(p) < kTurnsNow ? weight_of(group, p) : 0.0; }
  HWY_INLINE double of_cell(const double* numbers, int size, int i) const {
    return numbers[(static_cast<std::int64_t>(place_.batch) * size + i) * kBatch + place_.lane];
  }

  /// Adds what the nodes of a part contribute to G at a row of the table.
  HWY_INLINE void add_gradient(int row, int p, double (&G)[d * d]) const {
    const double* derivatives = table_ + row * kRow + part(p) * d * kNodes;
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { G[i] = 0; }
    VARIMESH_UNROLLED for (int n = 0; n < kNodes; ++n) {
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        const double derivative = derivatives[k * kNodes + n];
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
          G[i * d + k] = __builtin_fma(x_[p][n][i], derivative, G[i * d + k]);
        }
      }
    }
  }

  /// G of each part's own point of a group.
  HWY_INLINE void gradients(int group, double (&own)[kHereNow][d * d]) const {
    double sums[kHereNow][kTurnsNow][d * d];
    for (int p = 0; p < kHereNow; ++p) VARIMESH_UNROLLED for (int turn = 0; turn < kTurnsNow; ++turn) {
        add_gradient(group * kTurnsNow + turn, p, sums[p][turn]);
      }
    take_turns<parts>(sums, place_.first, own);
  }

  HWY_INLINE const double* left_factor() const {
    return a_.left_factor == nullptr
               ? nullptr
               : a_.left_factor + static_cast<std::int64_t>(place_.batch) * d * d * kBatch + place_.lane;
  }
  HWY_INLINE Matrix<Real, d> deformation(const double (&G)[d * d]) const {
    return deformation_at<d>(G, inverse_, left_factor());
  }

  /// Whether a part writes what is kept of its point: no other part does, and the point is none of the padding.
  HWY_INLINE bool writes(int group, int p) const { return part(p) < kTurnsNow && point(group, p) < a_.points; }
  /// Where the numbers of a part's point begin in an array of `size` numbers per point.
  HWY_INLINE std::int64_t at_point(int group, int p, int size) const {
    return (static_cast<std::int64_t>(place_.batch) * a_.points + point(group, p)) * size * kBatch + place_.lane;
  }

  /// Keeps the mean of F and the step of its differences from it.
  HWY_INLINE void keep_range(float (&middle)[d * d], float& step) const {
    double G[d * d][kHereNow];
    for (int p = 0; p < kHereNow; ++p) {
      double mean[d * d];
      add_gradient(groups_ * kTurnsNow, p, mean);
      VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { G[i][p] = mean[i]; }
    }
    double of_points[d * d];
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) {
      over_parts<parts>(G[i], [](double a, double b) { return a + b; });
      of_points[i] = G[i][0];
    }
    const Matrix<Real, d> mean = deformation(of_points);
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { middle[i] = static_cast<float>(mean[i / d][i % d].value); }
    double largest[kHereNow];
    for (int p = 0; p < kHereNow; ++p) largest[p] = 0;
    VARIMESH_NOT_UNROLLED
    for (int group = 0; group < groups_; ++group) {
      double own[kHereNow][d * d];
      gradients(group, own);
      for (int p = 0; p < kHereNow; ++p) {
        const Matrix<Real, d> F = deformation(own[p]);
        VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) {
          const double difference = __builtin_fabs(F[i / d][i % d].value - static_cast<double>(middle[i]));
          largest[p] = difference > largest[p] ? difference : largest[p];
        }
      }
    }
    over_parts<parts>(largest, [](double a, double b) { return b > a ? b : a; });
    step = step_of(largest[0]);
    if (place_.first != 0) return;
    float* to = a_.mean + static_cast<std::int64_t>(place_.batch) * (d * d + 1) * kBatch + place_.lane;
    VARIMESH_UNROLLED for (int i = 0; i < d * d; ++i) { to[i * kBatch] = middle[i]; }
    to[d * d * kBatch] = step;
  }

  const Arguments& a_;
  const double* table_;
  const Place<parts> place_;
  const E energy_;
  const int groups_;
  double x_[kHereNow][kNodes][d];
  double inverse_[d * d];
  double measure_, delta_squared_;
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
