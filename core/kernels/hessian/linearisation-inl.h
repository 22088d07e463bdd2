// What Newton's method computes in each cell before its products: the gradient in double precision, and what the
// products need of each point in single precision. One quadrature point per lane.
//
// With F = G A⁻¹ and G = Σ x_n ⊗ ∇_ξ φ_n, the chain rule gives a cell's contribution to the gradient at node n: Σ w P
// A⁻ᵀ ∇_ξ φ_n. P = dW/dF comes from core/energy/density-inl.h.
#if defined(VARIMESH_HESSIAN_LINEARISATION_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_LINEARISATION_INL_H
#undef VARIMESH_HESSIAN_LINEARISATION_INL_H
#else
#define VARIMESH_HESSIAN_LINEARISATION_INL_H
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

#include "core/energy/density-inl.h"
#include "core/energy/table-inl.h"
#include "core/kernels/hessian/batches.h"
#include "core/kernels/hessian/fixed_point_16.h"
#include "core/kernels/hessian/kept_partials-inl.h"
#include "core/kernels/left_factor.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// What does not depend on the energy. It is compiled once for each dimension, and what does once for each energy.
template <int d>
class LinearisationOfAnyEnergy : public HessianKernels {
 public:
  HWY_FLATTEN void linearise(BatchSet& set, std::int32_t b, const double* deformation) const override {
    const CellSet& cells = *set.cells;
    static thread_local AlignedVector<double> stress;
    stress.resize(kCellsAtOnce * cells.deformation_size());
    for (int lane = 0; lane < kBatch; ++lane) {
      // Lanes past the last cell repeat it with weight 0.
      const std::int32_t cell = std::min(b * kBatch + lane, cells.count - 1);
      const double slope = cell < b * kBatch + lane ? 0.0 : slope_of(cells, cell);
      const double* F = deformation + (cell - b * kBatch) * cells.deformation_size();
      keep_deformation(set, b, lane, F);
      linearise_cell(set, cell, slope, F, set.linearisation.data() + b * set.linearisation_size() + lane,
                     stress.data() + lane % kCellsAtOnce * cells.deformation_size());
      if ((lane + 1) % kCellsAtOnce == 0)
        cell_gradients<kCellsAtOnce>(set, b * kBatch + lane + 1 - kCellsAtOnce, stress.data());
    }
  }

  HWY_FLATTEN void gradient(BatchSet& set, std::int32_t b, const double* deformation) const override {
    const CellSet& cells = *set.cells;
    static thread_local AlignedVector<double> stress;
    stress.resize(kCellsAtOnce * cells.deformation_size());
    const int lanes = std::min(kBatch, cells.count - b * kBatch);
    for (int lane = 0; lane < lanes; ++lane) {
      const std::int32_t cell = b * kBatch + lane;
      const double* F = deformation + lane * cells.deformation_size();
      linearise_cell(set, cell, slope_of(cells, cell), F, nullptr,
                     stress.data() + lane % kCellsAtOnce * cells.deformation_size());
      if ((lane + 1) % kCellsAtOnce == 0)
        cell_gradients<kCellsAtOnce>(set, cell + 1 - kCellsAtOnce, stress.data());
      else if (lane + 1 == lanes)
        cell_gradients<1>(set, cell, stress.data());
    }
  }

 protected:
  using PointTag = hn::CappedTag<double, kPointPadding>;
  using Points = hn::Vec<PointTag>;

  /// Computes the partial derivatives that are kept of a cell (`kept`, as BatchSet::linearisation; null: they are not
  /// needed), and w dW/dG at its points (`stress`, d·d × stride).
  virtual void linearise_cell(const BatchSet& set, std::int32_t cell, double slope, const double* deformation,
                              float* kept, double* stress) const = 0;

 private:
  /// The sums of one node wait for each other, and the table of derivatives is larger than the first cache. So the sums
  /// of some nodes in some cells are taken side by side.
  static constexpr int kNodesAtOnce = 2, kCellsAtOnce = 2;
  static_assert(kBatch % kCellsAtOnce == 0);

  static double slope_of(const CellSet& cells, std::int32_t cell) {
    return cells.energy_slope.empty() ? 1.0 : cells.energy_slope[cell];
  }

  /// Writes F of one cell to BatchSet::deformation and BatchSet::mean.
  static HWY_INLINE void keep_deformation(BatchSet& set, std::int32_t b, int lane, const double* deformation) {
    const CellSet& cells = *set.cells;
    float* mean = set.mean.data() + static_cast<std::size_t>(b) * (d * d + 1) * kBatch + lane;
    double largest = 0;
    for (int entry = 0; entry < d * d; ++entry) {
      const double* F = deformation + entry * cells.stride;
      const float middle = static_cast<float>(std::accumulate(F, F + cells.points, 0.0) / cells.points);
      for (int q = 0; q < cells.points; ++q) largest = std::max(largest, std::abs(F[q] - middle));
      mean[entry * kBatch] = middle;
    }
    // At least the smallest normal float, to divide by.
    const float step = std::max(static_cast<float>(largest / kLargestFixedPoint), std::numeric_limits<float>::min());
    mean[d * d * kBatch] = step;
    std::int16_t* to = set.deformation.data() + b * set.deformation_size() + lane;
    for (int entry = 0; entry < d * d; ++entry)
      for (int q = 0; q < cells.points; ++q) {
        to[(set.gradient.slots[q] * d * d + entry) * kBatch] =
            to_fixed_point((deformation[entry * cells.stride + q] - mean[entry * kBatch]) / step);
      }
  }

  /// x without the digits that do not fit in a float. It does not convert to float and back: when GCC 12.2 vectorises
  /// straight-line code, it turns (double)(float)x into x (with g++ -O2, x − (double)(float)x is then 0).
  static HWY_INLINE double with_a_floats_digits(double x) {
    return std::bit_cast<double>(std::bit_cast<std::uint64_t>(x) & ~((std::uint64_t{1} << 29) - 1));
  }

  /// Each node's contribution Σ w dW/dG ∂φ_n/∂ξ, times L, as two floats per component, of the cells from `first` on.
  /// Those past the last cell repeat it. `stress`: kCells × d·d × stride, of linearise_cell().
  template <int kCells>
  static HWY_INLINE void cell_gradients(BatchSet& set, std::int32_t first, const double* stress) {
    const int nodes = set.cells->nodes_per_cell;
    int n = 0;
    for (; n + kNodesAtOnce <= nodes; n += kNodesAtOnce) node_gradients<kNodesAtOnce, kCells>(set, first, n, stress);
    for (; n < nodes; ++n) node_gradients<1, kCells>(set, first, n, stress);
  }

  template <int kNodes, int kCells>
  static HWY_INLINE void node_gradients(BatchSet& set, std::int32_t first_cell, int first_node, const double* stress) {
    const PointTag tag;
    const CellSet& cells = *set.cells;
    const double* slopes[kNodes];
    Points sum[kNodes][kCells][d];
    unrolled<kNodes>([&](auto n) {
      slopes[n] = cells.derivatives_of(first_node + n);
      unrolled<kCells * d>([&](auto i) { sum[n][i / d][i % d] = hn::Zero(tag); });
    });
    for (int q = 0; q < cells.stride; q += static_cast<int>(hn::Lanes(tag)))
      unrolled<d>([&](auto k) {
        Points slope[kNodes];
        unrolled<kNodes>([&](auto n) { slope[n] = hn::Load(tag, slopes[n] + k * cells.stride + q); });
        unrolled<kCells * d>([&](auto i) {
          const Points entry = hn::Load(tag, stress + ((i / d * d + i % d) * d + k) * cells.stride + q);
          unrolled<kNodes>([&](auto n) { sum[n][i / d][i % d] = hn::MulAdd(entry, slope[n], sum[n][i / d][i % d]); });
        });
      });
    unrolled<kNodes>([&](auto n) {
      unrolled<kCells>([&](auto c) {
        keep_gradient(sum[n][c], cells.left_factor_of(std::min(first_cell + c, cells.count - 1)),
                      set.contributions.data() + set.contribution_index(first_cell + c, first_node + n, 2 * d));
      });
    });
  }

  /// Adds up the lanes, and multiplies by L if there is one.
  static HWY_INLINE void keep_gradient(const Points (&sum)[d], const double* left_factor, float* contribution) {
    double g[d];
    unrolled<d>([&](auto i) { g[i] = hn::GetLane(hn::SumOfLanes(PointTag(), sum[i])); });
    if (left_factor) {
      double turned[d];
      varimesh::times_left_factor(left_factor, d, g, turned);
      std::copy_n(turned, d, g);
    }
    for (int i = 0; i < d; ++i) {
      const double high = with_a_floats_digits(g[i]);
      contribution[i] = static_cast<float>(high);
      contribution[d + i] = static_cast<float>(g[i] - high);
    }
  }
};

/// What depends on the energy. Base: LinearisationOfAnyEnergy<d>, or a class that is derived from it.
template <class E, int d, class Base>
class LinearisationOfEnergy : public Base {
  using PointTag = typename Base::PointTag;
  using Points = typename Base::Points;
  using Kept = KeptPartials<E>;

 public:
  /// `base`: what is passed on to Base.
  template <class... Rest>
  explicit LinearisationOfEnergy(const E& energy, const Rest&... base) : Base(base...), energy_(energy) {}

  int entries() const override { return Kept::kEntries; }

 protected:
  E energy_;

  HWY_FLATTEN void linearise_cell(const BatchSet& set, std::int32_t cell, double slope, const double* deformation,
                                  float* kept, double* stress) const override {
    kept != nullptr ? linearise_points<true>(set, cell, slope, deformation, kept, stress)
                    : linearise_points<false>(set, cell, slope, deformation, kept, stress);
  }

 private:
  /// As linearise_cell().
  template <bool kKeeps>
  HWY_INLINE void linearise_points(const BatchSet& set, std::int32_t cell, double slope, const double* deformation,
                                   float* kept, double* stress) const {
    const PointTag tag;
    const CellSet& cells = *set.cells;
    const int width = static_cast<int>(hn::Lanes(tag));
    const double* inverse = cells.inverse_target_of(cell);
    for (int q = 0; q < cells.stride; q += width) {
      const Points weight = hn::Set(tag, slope) * (cells.affine ? hn::Load(tag, cells.weights.data() + q) *
                                                                      hn::Set(tag, *cells.measure_of(cell))
                                                                : hn::Load(tag, cells.measure_of(cell) + q));
      alignas(64) double entries[Kept::kEntries][kPointPadding];
      const Matrix<Points, d> P = expand(deformation + q, cells.stride, weight, cells.delta_squared[cell], entries);
      for (int p = 0; kKeeps && p < std::min(width, cells.points - q); ++p)
        for (int entry = 0; entry < Kept::kEntries; ++entry)
          kept[(set.gradient.slots[q + p] * Kept::kEntries + entry) * kBatch] = static_cast<float>(entries[entry][p]);
      for (int i = 0; i < d; ++i)
        for (int k = 0; k < d; ++k) {
          Points sum = hn::Zero(tag);  // P A⁻ᵀ
          for (int j = 0; j < d; ++j)
            sum = hn::MulAdd(P[i][j],
                             cells.affine ? hn::Set(tag, inverse[k * d + j])
                                          : hn::Load(tag, inverse + (k * d + j) * cells.stride + q),
                             sum);
          hn::Store(sum, tag, stress + (i * d + k) * cells.stride + q);
        }
    }
  }

  /// Computes the partial derivatives that are kept of some points, one per lane; returns w P.
  HWY_INLINE Matrix<Points, d> expand(const double* deformation, int stride, Points w, double delta_squared,
                                      double (*kept)[kPointPadding]) const {
    const PointTag tag;
    Matrix<Points, d> F;
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < d; ++j) F[i][j] = hn::Load(tag, deformation + (i * d + j) * stride);
    const Matrix<Points, d> C = cofactor<d>(F);
    const Points Q = E::kQuadratic == Quadratic::Cofactor ? dot<d>(C, C) : dot<d>(F, F);
    const Partials<Points> p =
        energy_.partials(Q, regularised<E::kFunction>(determinant<d>(F), hn::Set(tag, delta_squared)));
    hn::Store(w * p.f_Q, tag, kept[Kept::kQ]);
    hn::Store(w * p.f_J, tag, kept[Kept::kJ]);
    hn::Store(w * p.f_JJ, tag, kept[Kept::kJJ]);
    if constexpr (E::kMixed) hn::Store(w * p.f_QJ, tag, kept[Kept::kQJ]);
    if constexpr (E::kCurved) hn::Store(w * p.f_QQ, tag, kept[Kept::kQQ]);
    if constexpr (E::kStrain != StrainTerm::None) hn::Store(w, tag, kept[Kept::kW]);
    Matrix<Points, d> P = density_gradient<d>(energy_, F, C, p);
    for (int k = 0; k < d * d; ++k) P[k / d][k % d] = w * P[k / d][k % d];
    return P;
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
