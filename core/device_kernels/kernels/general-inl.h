// Kernels for cells of any shape and order, with any targets: one thread for each point of a cell, then one for each of
// its nodes. What is computed at the points passes through memory, so nothing has to fit in registers.
//
// Each function is one thread. Threads of a batch are numbered point by point (or node by node), the lane innermost.
#if defined(VARIMESH_DEVICE_GENERAL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_GENERAL_INL_H
#undef VARIMESH_DEVICE_GENERAL_INL_H
#else
#define VARIMESH_DEVICE_GENERAL_INL_H
#endif

#include <limits>

#include "core/device_kernels/kernels/arguments.h"
#include "core/device_kernels/kernels/points-inl.h"
#include "core/kernels/hessian/kept_points-inl.h"
#include "core/kernels/hessian/stress_change-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <class E, int d>
class GeneralThread {
  using Arguments = device::GeneralArguments;
  using Kept = KeptPartials<E>;

 public:
  /// @param per_batch  threads per batch and lane: points, nodes, or 1
  HWY_INLINE GeneralThread(const Arguments& arguments, std::int64_t thread, int per_batch)
      : a_(arguments),
        batch_(static_cast<std::int32_t>(thread / kBatch / per_batch)),
        own_(static_cast<int>(thread / kBatch % per_batch)),
        lane_(static_cast<int>(thread % kBatch)),
        energy_(arguments.material) {}
  /// Whether there is such a batch.
  HWY_INLINE bool exists() const { return batch_ < a_.batches; }

  /// F at a point.
  HWY_INLINE void deform() const {
    const Matrix<Real, d> F = deformation_of_shape();
    for (int i = 0; i < d * d; ++i) field(own_)[i * kBatch] = F[i / d][i % d].value;
  }

  /// The scan of a cell, from F at its points.
  HWY_INLINE void scan() const {
    double energy = 0, smallest = std::numeric_limits<double>::infinity();
    double least = smallest, most = -smallest;
    for (int point = 0; point < a_.points; ++point) {
      const Matrix<Real, d> F = deformation(point);
      const double J = determinant<d>(F).value, volume = volume_of(point);
      energy = __builtin_fma(a_.weights[point] * volume, density_value<d>(energy_, F, delta_squared()).value, energy);
      smallest = J < smallest ? J : smallest;
      least = J * volume < least ? J * volume : least;
      most = J * volume > most ? J * volume : most;
    }
    double* to = a_.scans + static_cast<std::int64_t>(batch_) * 3 * kBatch + lane_;
    to[0] = energy;
    to[kBatch] = smallest;
    to[2 * kBatch] = scaled_jacobian(least, most);
  }

  /// The mean of F in a cell and the step of the differences from it.
  HWY_INLINE void range() const {
    float* to = a_.mean + static_cast<std::int64_t>(batch_) * (d * d + 1) * kBatch + lane_;
    double largest = 0;
    for (int i = 0; i < d * d; ++i) {
      double sum = 0;
      for (int point = 0; point < a_.points; ++point) sum = sum + field(point)[i * kBatch];
      const float middle = static_cast<float>(sum / a_.points);
      for (int point = 0; point < a_.points; ++point) {
        const double difference = __builtin_fabs(field(point)[i * kBatch] - static_cast<double>(middle));
        largest = difference > largest ? difference : largest;
      }
      to[i * kBatch] = middle;
    }
    to[d * d * kBatch] = step_of(largest);
  }

  /// Replaces F at a point by w P A⁻ᵀ; with `keeps`, writes what products need.
  template <bool keeps>
  HWY_INLINE void stress() const {
    const Matrix<Real, d> F = deformation(own_);
    float* kept = nullptr;
    if constexpr (keeps) {
      const float* mean = a_.mean + static_cast<std::int64_t>(batch_) * (d * d + 1) * kBatch + lane_;
      float middle[d * d];
      for (int i = 0; i < d * d; ++i) middle[i] = mean[i * kBatch];
      write_steps<d>(F, middle, mean[d * d * kBatch], a_.deformation + at_point(own_, d * d));
      kept = a_.linearisation + at_point(own_, Kept::kEntries);
    }
    double inverse[d * d], out[d * d];
    load_inverse(own_, inverse);
    const Real slope{a_.slope[static_cast<std::int64_t>(batch_) * kBatch + lane_]};
    const Real w = slope * (Real{a_.weights[own_]} * Real{volume_of(own_)});
    stress_at<keeps, d>(energy_, F, w, delta_squared(), inverse, kept, out);
    for (int i = 0; i < d * d; ++i) field(own_)[i * kBatch] = out[i];
  }

  /// The contribution of a cell to the gradient at a node. Four sums round less than one, and do not wait for each
  /// other.
  HWY_INLINE void gradient() const {
    double sums[4][d] = {};
    for (int first = 0; first < a_.points; first += 4) {
      VARIMESH_UNROLLED for (int j = 0; j < 4; ++j) {
        const int point = first + j;
        if (point >= a_.points) continue;
        VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
          const double derivative = derivative_of(own_, point, k);
          VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
            sums[j][i] = __builtin_fma(field(point)[(i * d + k) * kBatch], derivative, sums[j][i]);
          }
        }
      }
    }
    double sum[d];
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { sum[i] = (sums[0][i] + sums[1][i]) + (sums[2][i] + sums[3][i]); }
    write_gradient<d>(sum, left_factor(), contribution(2 * d));
  }

  /// w dP A⁻ᵀ at a point, along the direction.
  HWY_INLINE void change_stress() const {
    float G[d * d] = {};
    for (int n = 0; n < a_.nodes; ++n) {
      const float* x = a_.direction + static_cast<std::int64_t>(of_batch(a_.ranks, a_.nodes)[n * kBatch]) * d;
      float u[d];
      times_left_factor(x, u);
      for (int k = 0; k < d; ++k) {
        const float derivative = static_cast<float>(derivative_of(n, own_, k));
        for (int i = 0; i < d; ++i) G[i * d + k] = __builtin_fmaf(u[i], derivative, G[i * d + k]);
      }
    }
    const FloatMatrix<d> inverse = inverse_target(own_);
    FloatMatrix<d> dG;
    for (int i = 0; i < d * d; ++i) dG.at[i / d][i % d] = Floats{G[i]};
    const KeptPoints<d> kept = kept_points();
    const FloatMatrix<d> out =
        stress_change(energy_, kept.deformation(own_), kept.partials(own_), dG.template times<false>(inverse))
            .template times<true>(inverse);
    float* to = a_.changes + at_point(own_, d * d);
    for (int i = 0; i < d * d; ++i) to[i * kBatch] = out.at[i / d][i % d].value;
  }

  /// The contribution of a cell to the product at a node.
  HWY_INLINE void product() const {
    float sum[d] = {};
    for (int point = 0; point < a_.points; ++point)
      for (int k = 0; k < d; ++k) {
        const float derivative = static_cast<float>(derivative_of(own_, point, k));
        const float* change = a_.changes + at_point(point, d * d);
        for (int i = 0; i < d; ++i) sum[i] = __builtin_fmaf(change[(i * d + k) * kBatch], derivative, sum[i]);
      }
    float turned[d];
    times_left_factor(sum, turned);
    for (int i = 0; i < d; ++i) contribution(d)[i] = turned[i];
  }

 protected:
  /// What was kept of the cell's points.
  HWY_INLINE KeptPoints<d> kept_points() const {
    return KeptPoints<d>(a_.linearisation + at_batch(Kept::kEntries), Kept::kEntries, a_.deformation + at_batch(d * d),
                         a_.mean + static_cast<std::int64_t>(batch_) * (d * d + 1) * kBatch, lane_);
  }
  /// A⁻¹ in single precision.
  HWY_INLINE FloatMatrix<d> inverse_target(int point) const {
    double numbers[d * d];
    load_inverse(point, numbers);
    FloatMatrix<d> inverse;
    for (int i = 0; i < d * d; ++i) inverse.at[i / d][i % d] = Floats{static_cast<float>(numbers[i])};
    return inverse;
  }
  /// The number of the cell's own node among those of all cells of the set.
  HWY_INLINE std::int64_t cell_node() const {
    return (static_cast<std::int64_t>(batch_) * a_.nodes + own_) * kBatch + lane_;
  }
  HWY_INLINE std::int64_t at_batch(int size) const {
    return static_cast<std::int64_t>(batch_) * a_.points * size * kBatch;
  }
  HWY_INLINE std::int64_t at_point(int point, int size) const {
    return at_batch(size) + static_cast<std::int64_t>(point) * size * kBatch + lane_;
  }
  template <class T>
  HWY_INLINE const T* of_batch(const T* numbers, int size) const {
    return numbers + static_cast<std::int64_t>(batch_) * size * kBatch + lane_;
  }
  /// Of an array with one entry of `size` numbers per cell if the targets are constant in each, else per point.
  HWY_INLINE const double* of_target(const double* numbers, int point, int size) const {
    const int points = a_.affine ? 1 : a_.points;
    return numbers + (static_cast<std::int64_t>(batch_) * points + (a_.affine ? 0 : point)) * size * kBatch + lane_;
  }
  HWY_INLINE void load_inverse(int point, double (&inverse)[d * d]) const {
    const double* from = of_target(a_.inverse_target, point, d * d);
    for (int i = 0; i < d * d; ++i) inverse[i] = from[i * kBatch];
  }
  HWY_INLINE double volume_of(int point) const { return *of_target(a_.measure, point, 1); }
  HWY_INLINE Real delta_squared() const { return Real{*of_batch(a_.delta_squared, 1)}; }
  HWY_INLINE const double* left_factor() const {
    return a_.left_factor == nullptr ? nullptr : of_batch(a_.left_factor, d * d);
  }
  HWY_INLINE double derivative_of(int node, int point, int k) const {
    return a_.derivatives[(static_cast<std::int64_t>(point) * d + k) * a_.nodes + node];
  }
  /// F at the thread's own point, from the positions of the nodes.
  HWY_INLINE Matrix<Real, d> deformation_of_shape() const {
    double G[d * d] = {};
    for (int n = 0; n < a_.nodes; ++n) {
      const double* x = a_.positions + static_cast<std::int64_t>(of_batch(a_.cell_nodes, a_.nodes)[n * kBatch]) * d;
      add_outer(x, n, own_, G);
    }
    double inverse[d * d];
    load_inverse(own_, inverse);
    return deformation_at<d>(G, inverse, left_factor());
  }
  HWY_INLINE double* field(int point) const { return a_.fields + at_point(point, d * d); }
  HWY_INLINE Matrix<Real, d> deformation(int point) const {
    Matrix<Real, d> F;
    for (int i = 0; i < d * d; ++i) F[i / d][i % d] = Real{field(point)[i * kBatch]};
    return F;
  }
  HWY_INLINE float* contribution(int width) const { return a_.contributions + cell_node() * width; }
  HWY_INLINE void add_outer(const double* x, int node, int point, double (&G)[d * d]) const {
    for (int k = 0; k < d; ++k) {
      const double derivative = derivative_of(node, point, k);
      for (int i = 0; i < d; ++i) G[i * d + k] = __builtin_fma(x[i], derivative, G[i * d + k]);
    }
  }
  HWY_INLINE void times_left_factor(const float* x, float (&out)[d]) const {
    const double* L = left_factor();
    for (int i = 0; i < d; ++i) {
      out[i] = x[i];
      if (L == nullptr) continue;
      out[i] = 0;
      for (int k = 0; k < d; ++k) out[i] = __builtin_fmaf(static_cast<float>(L[(i * d + k) * kBatch]), x[k], out[i]);
    }
  }

  const Arguments& a_;
  const std::int32_t batch_;
  const int own_;  ///< The point or the node.
  const int lane_;
  const E energy_;
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
