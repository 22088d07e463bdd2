// Products of the energy's second derivative with a direction, one cell per lane, in single precision.
//
// For a direction u at the nodes, dG = Σ u_n ⊗ ∇_ξ φ_n and dF = dG A⁻¹ at every point. With the change dP of the stress
// along dF (stress_change-inl.h), the cell's contribution to the product at node n is Σ w dP A⁻ᵀ ∇_ξ φ_n. The gradient
// operator and its transpose would be most of the work; the mirrors of the cell make them cheaper (folded_gradient.h).
#if defined(VARIMESH_HESSIAN_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_INL_H
#undef VARIMESH_HESSIAN_INL_H
#else
#define VARIMESH_HESSIAN_INL_H
#endif

#include <array>
#include <numeric>

#include "core/base/index.h"
#include "core/energy/table-inl.h"
#include "core/kernels/hessian/batches.h"
#include "core/kernels/hessian/cell_lanes-inl.h"
#include "core/kernels/hessian/folded_gradient-inl.h"
#include "core/kernels/hessian/kept_points-inl.h"
#include "core/kernels/hessian/linearisation-inl.h"
#include "core/kernels/hessian/node_vector-inl.h"
#include "core/kernels/hessian/stress_change-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// What does not depend on the energy. It is compiled once for each dimension, and what does once for each energy.
template <int d>
class HessianOfAnyEnergy : public LinearisationOfAnyEnergy<d> {
  using Gradient = FoldedLanes<d>;
  using Cells = CellLanes<d>;
  static constexpr int kSides = triangle_size(d);  // numbers in a symmetric d × d matrix
  static constexpr int kTensor = tensor_size(d);

 public:
  HWY_FLATTEN void node_blocks(BatchSet& set, std::int32_t b) const override {
    const int nodes = set.cells->nodes_per_cell;
    static thread_local AlignedVector<float> scratch;
    scratch.resize(static_cast<std::size_t>(nodes) * kSides * kBatch);
    for (int lane = 0; lane < kBatch; lane += static_cast<int>(hn::Lanes(FloatTag())))
      add_up_blocks(set, b, lane, scratch.data() + lane);
    for (int n = 0; n < nodes; ++n)
      for (int lane = 0; lane < kBatch; ++lane) {
        float* to = set.contributions.data() + set.contribution_index(b * kBatch + lane, n, 2 * d);
        for (int entry = 0; entry < kSides; ++entry) to[entry] = scratch[(n * kSides + entry) * kBatch + lane];
        if (!set.left_factor.empty()) turn_block_by_left_factor(set, b, lane, to);
      }
  }

  HWY_FLATTEN void mean_tensors(const BatchSet& set, std::int32_t b, std::vector<float>& out) const override {
    const CellSet& cells = *set.cells;
    const int per_cell = cells.affine ? 1 : cells.points;
    alignas(64) float sums[kTensor * kBatch];
    for (int lane = 0; lane < kBatch; lane += static_cast<int>(hn::Lanes(FloatTag()))) {
      const KeptPoints<d> kept(set, b, lane);
      Floats M[kTensor];
      unrolled<kTensor>([&](auto entry) { M[entry] = hn::Zero(FloatTag()); });
      for (int q = 0; q < cells.points; ++q) {
        FloatMatrix<d> inverse;
        inverse.load_from(set.inverse_target.data() +
                          (static_cast<std::size_t>(b) * per_cell + (cells.affine ? 0 : q)) * d * d * kBatch + lane);
        inverse = in_reference_coordinates(set, inverse);
        add_mean(kept.deformation(q), kept.partials(q), inverse, M);
      }
      unrolled<kTensor>([&](auto entry) { hn::Store(M[entry], FloatTag(), sums + entry * kBatch + lane); });
    }
    for (int lane = 0; lane < kBatch && b * kBatch + lane < cells.count; ++lane) {
      float* to = out.data() + static_cast<std::size_t>(b * kBatch + lane) * kTensor;
      for (int entry = 0; entry < kTensor; ++entry) to[entry] = sums[entry * kBatch + lane];
      if (!set.left_factor.empty()) turn_by_left_factor(set, b, lane, to);
    }
  }

  void apply(BatchSet& set, std::int32_t b, std::span<const float> direction) const override {
    const CellSet& cells = *set.cells;
    const int nodes = cells.nodes_per_cell;
    // Scratch of the thread: `u` has the direction at the batch's nodes and in the end the product; `components` has
    // the components of `u`; `slopes` has dG and then w dP A⁻ᵀ at the points.
    static thread_local AlignedVector<float> scratch;
    const std::size_t direction_size = static_cast<std::size_t>(nodes) * d * kBatch;
    scratch.resize(2 * direction_size + static_cast<std::size_t>(cells.points) * d * d * kBatch);
    float* u = scratch.data();
    float* components = u + direction_size;
    float* slopes = components + direction_size;
    Cells::gather(set.ranks.data() + static_cast<std::size_t>(b) * nodes * kBatch, nodes, direction.data(), u);
    times_left_factor(set, b, u);
    for (int lane = 0; lane < kBatch; lane += static_cast<int>(hn::Lanes(FloatTag()))) {
      Gradient::fold(set.gradient, u + lane, components + lane);
      Gradient::forward(set.gradient, components + lane, slopes + lane);
      at_points(set, b, lane, slopes + lane);
      Gradient::backward(set.gradient, slopes + lane, components + lane);
      Gradient::unfold(set.gradient, components + lane, u + lane);
    }
    times_left_factor(set, b, u);
    Cells::interleave(u, nodes, set.contributions.data() + set.contribution_index(b * kBatch, 0, d));
  }

  double add_up(const Problem& problem, const std::vector<BatchSet>& batches, const float* direction, float* product,
                std::int32_t first, std::int32_t last) const override {
    const std::array<Contributions, kShapes> contributions =
        contributions_of(batches, [&](std::size_t b) { return batches[b].cells->nodes_per_cell; });
    double along[d] = {};  // one sum per component, so that no addition waits for the one before
    for (std::int32_t rank = first; rank < last; ++rank) {
      const Incidence* cells = problem.incidences.data();
      const NodeVector<d> sum =
          sum_of_contributions<d>(cells + problem.offsets[rank], cells + problem.offsets[rank + 1], contributions);
      alignas(16) float numbers[4];
      sum.store(numbers);
      float* to = product + static_cast<std::ptrdiff_t>(rank) * d;
      const float* with = direction + static_cast<std::ptrdiff_t>(rank) * d;
      unrolled<d>([&](auto k) {
        to[k] = numbers[k];
        along[k] += static_cast<double>(numbers[k]) * with[k];
      });
    }
    return std::accumulate(along, along + d, 0.0);
  }

 protected:
  /// The μ of the energy's strain term, and where its weight w is among the kept partial derivatives; −1: there is
  /// none.
  struct StrainOfEnergy {
    float mu = 0;
    int weight = -1;
  };
  explicit HessianOfAnyEnergy(StrainOfEnergy strain) : strain_(strain) {}

  /// change[j][l] = w dP A⁻ᵀ for dG = e_j ⊗ e_l.
  virtual void stress_changes(const FloatMatrix<d>& F, const float* partials, const FloatMatrix<d>& inverse,
                              FloatMatrix<d> (&change)[d][d]) const = 0;
  /// Replaces dG by w dP A⁻ᵀ in `count` slots from `first` on.
  virtual void at_values(const BatchSet& set, std::int32_t b, int lane, int first, int count, float* slopes) const = 0;

 private:
  const StrainOfEnergy strain_;

  /// out[(n kSides + ij) kBatch] = Σ over points of T(ik, jl) ∂_k φ_n ∂_l φ_n, with T = w A⁻¹ (d²W/dF²) A⁻ᵀ.
  HWY_INLINE void add_up_blocks(const BatchSet& set, std::int32_t b, int lane, float* out) const {
    const FloatTag tag;
    const CellSet& cells = *set.cells;
    const int nodes = cells.nodes_per_cell, per_cell = cells.affine ? 1 : cells.points;
    const KeptPoints<d> kept(set, b, lane);
    const float* targets = set.inverse_target.data() + static_cast<std::size_t>(b) * per_cell * d * d * kBatch + lane;
    for (int entry = 0; entry < nodes * kSides; ++entry) hn::Store(hn::Zero(tag), tag, out + entry * kBatch);
    for (int q = 0; q < cells.points; ++q) {
      FloatMatrix<d> inverse;
      inverse.load_from(targets + static_cast<std::size_t>(cells.affine ? 0 : q) * d * d * kBatch);
      alignas(64) float T[kSides * kSides * kBatch];
      FloatMatrix<d> change[d][d];
      stress_changes(kept.deformation(q), kept.partials(q), inverse, change);
      point_tensor(change, T);
      const float* squares = set.squares.data() + static_cast<std::size_t>(q) * nodes * kSides;
      for (int n = 0; n < nodes; ++n)
        unrolled<kSides>([&](auto ij) {
          float* to = out + (n * kSides + ij) * kBatch;
          Floats sum = load(to);
          unrolled<kSides>([&](auto kl) {
            sum = hn::MulAdd(load(T + (ij * kSides + kl) * kBatch), every(squares[n * kSides + kl]), sum);
          });
          hn::Store(sum, tag, to);
        });
    }
  }

  /// T(ik, jl) for i ≥ j and k ≥ l; for k ≠ l the sum of T(ik, jl) and T(il, jk). `change` is from stress_changes().
  static HWY_INLINE void point_tensor(const FloatMatrix<d> (&change)[d][d], float* T) {
    for (int i = 0; i < d; ++i)
      for (int j = 0; j <= i; ++j)
        for (int k = 0; k < d; ++k)
          for (int l = 0; l <= k; ++l) {
            const Floats one = change[j][l].at[i][k];
            hn::Store(k == l ? one : one + change[j][k].at[i][l], FloatTag(),
                      T + (lower_index(i, j) * kSides + lower_index(k, l)) * kBatch);
          }
  }

  /// Replaces the symmetric block B by L B L; `triangle` is its lower triangle by rows.
  static void turn_block_by_left_factor(const BatchSet& set, std::int32_t b, int lane, float* triangle) {
    const float* L = set.left_factor.data() + static_cast<std::size_t>(b) * d * d * kBatch + lane;
    float turned[kSides] = {};
    for (int i = 0; i < d; ++i)
      for (int j = 0; j <= i; ++j)
        for (int k = 0; k < d; ++k)
          for (int l = 0; l < d; ++l)
            turned[lower_index(i, j)] +=
                L[(i * d + k) * kBatch] * L[(j * d + l) * kBatch] * triangle[symmetric_index(k, l)];
    std::copy_n(turned, kSides, triangle);
  }

  /// Multiplies the vectors at a batch's nodes with the left factors of their cells, in place. L is symmetric, so this
  /// is right for a direction and for the result.
  static HWY_NOINLINE void times_left_factor(const BatchSet& set, std::int32_t b, float* vectors) {
    if (set.left_factor.empty()) return;
    const float* factor = set.left_factor.data() + static_cast<std::size_t>(b) * d * d * kBatch;
    for (int lane = 0; lane < kBatch; lane += static_cast<int>(hn::Lanes(FloatTag()))) {
      FloatMatrix<d> L;
      L.load_from(factor + lane);
      for (int n = 0; n < set.cells->nodes_per_cell; ++n) {
        float* at = vectors + n * d * kBatch + lane;
        Floats x[d];
        unrolled<d>([&](auto i) { x[i] = load(at + i * kBatch); });
        unrolled<d>([&](auto i) {
          Floats sum = L.at[i][0] * x[0];
          unrolled<d>([&](auto k) {
            if (k > 0) sum = hn::MulAdd(L.at[i][k], x[k], sum);
          });
          hn::Store(sum, FloatTag(), at + i * kBatch);
        });
      }
    }
  }

  /// A⁻¹ from the matrix in BatchSet::inverse_target.
  static HWY_INLINE FloatMatrix<d> in_reference_coordinates(const BatchSet& set, const FloatMatrix<d>& inverse) {
    const double* numbers = set.gradient.directions.data();  // column-major
    FloatMatrix<d> directions;
    unrolled<d>([&](auto i) {
      unrolled<d>([&](auto j) { directions.at[i][j] = every(static_cast<float>(numbers[j * d + i])); });
    });
    return directions.transposed_times(inverse);
  }

  /// Adds the term of one point to the mean tensor M (HessianKernels::mean_tensors).
  HWY_INLINE void add_mean(const FloatMatrix<d>& F, const float* partials, const FloatMatrix<d>& inverse,
                           Floats* M) const {
    Floats shape = load(partials + static_cast<int>(KeptPartial::Q) * kBatch) * every(2.0F);
    if (strain_.weight >= 0) shape = hn::MulAdd(load(partials + strain_.weight * kBatch), every(strain_.mu), shape);
    const Floats volume = hn::Max(load(partials + static_cast<int>(KeptPartial::JJ) * kBatch), hn::Zero(FloatTag()));
    const FloatMatrix<d> S = inverse.template times<true>(inverse);  // A⁻¹ A⁻ᵀ
    const FloatMatrix<d> c = cofactor_of<d>(F).template times<true>(inverse);
    unrolled<d * d>([&](auto ik) {
      unrolled_through(ik, [&](auto jl) {
        const int i = ik / d, k = ik % d, j = jl / d, l = jl % d;
        Floats& entry = M[lower_index(ik, jl)];
        entry = hn::MulAdd(volume * c.at[i][k], c.at[j][l], entry);
        if (i == j) entry = hn::MulAdd(shape, S.at[k][l], entry);
      });
    });
  }

  /// Replaces M by L M L, with L acting on i and j: displacements are multiplied with L before they become dG.
  static void turn_by_left_factor(const BatchSet& set, std::int32_t b, int lane, float* M) {
    const float* L = set.left_factor.data() + static_cast<std::size_t>(b) * d * d * kBatch + lane;
    float turned[kTensor] = {};
    for (int ik = 0; ik < d * d; ++ik)
      for (int jl = 0; jl <= ik; ++jl)
        for (int m = 0; m < d; ++m)
          for (int n = 0; n < d; ++n) {
            const int mk = m * d + ik % d, nl = n * d + jl % d, row = std::max(mk, nl), column = std::min(mk, nl);
            turned[lower_index(ik, jl)] +=
                L[(ik / d * d + m) * kBatch] * L[(jl / d * d + n) * kBatch] * M[lower_index(row, column)];
          }
    std::copy_n(turned, kTensor, M);
  }

  /// Replaces the components of dG by those of w dP A⁻ᵀ.
  HWY_INLINE void at_points(const BatchSet& set, std::int32_t b, int lane, float* slopes) const {
    for (const FoldedGradient::Orbit& orbit : set.gradient.point_orbits) {
      Gradient::turn(slopes, orbit);
      at_values(set, b, lane, orbit.component[0], 1 << orbit.mirrors, slopes);
      Gradient::turn(slopes, orbit);
    }
  }
};

/// What depends on the energy.
template <class E, int d>
class VectorHessian final : public LinearisationOfEnergy<E, d, HessianOfAnyEnergy<d>> {
  using Base = LinearisationOfEnergy<E, d, HessianOfAnyEnergy<d>>;

 public:
  explicit VectorHessian(const E& energy) : Base(energy, strain_of(energy)) {}

 protected:
  HWY_FLATTEN void stress_changes(const FloatMatrix<d>& F, const float* partials, const FloatMatrix<d>& inverse,
                                  FloatMatrix<d> (&change)[d][d]) const override {
    for (int j = 0; j < d; ++j)
      for (int l = 0; l < d; ++l) {
        FloatMatrix<d> dF;
        for (int i = 0; i < d; ++i)
          for (int m = 0; m < d; ++m) dF.at[i][m] = i == j ? inverse.at[l][m] : hn::Zero(FloatTag());
        change[j][l] = stress_change(this->energy_, F, partials, dF).template times<true>(inverse);
      }
  }

  HWY_FLATTEN void at_values(const BatchSet& set, std::int32_t b, int lane, int first, int count,
                             float* slopes) const override {
    const CellSet& cells = *set.cells;
    const KeptPoints<d> kept(set, b, lane);
    const int per_cell = cells.affine ? 1 : cells.points;
    const float* targets = set.inverse_target.data() + static_cast<std::size_t>(b) * per_cell * d * d * kBatch + lane;
    FloatMatrix<d> inverse;
    inverse.load_from(targets);
    for (int slot = first; slot < first + count; ++slot) {
      if (!cells.affine) inverse.load_from(targets + static_cast<std::size_t>(slot) * d * d * kBatch);
      float* slope = slopes + static_cast<std::size_t>(slot) * d * d * kBatch;
      FloatMatrix<d> dG;
      dG.load_from(slope);
      const FloatMatrix<d> out =
          stress_change(this->energy_, kept.deformation(slot), kept.partials(slot), dG.template times<false>(inverse))
              .template times<true>(inverse);
      unrolled<d>([&](auto i) {
        unrolled<d>([&](auto k) { hn::Store(out.at[i][k], FloatTag(), slope + (i * d + k) * kBatch); });
      });
    }
  }

 private:
  static auto strain_of(const E& energy) {
    typename HessianOfAnyEnergy<d>::StrainOfEnergy strain;
    if constexpr (E::kStrain != StrainTerm::None) strain = {static_cast<float>(energy.mu), KeptPartials<E>::kW};
    return strain;
  }
};

template <int d>
HessianKernels* new_hessian_kernels(const Material& material) {
  return with_energy<d>(material,
                        [](auto energy) -> HessianKernels* { return new VectorHessian<decltype(energy), d>(energy); });
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
