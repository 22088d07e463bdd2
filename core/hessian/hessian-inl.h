// Products of the energy's second derivative with a direction, a lane a cell, in single precision.
//
// For a direction u on the nodes, dG = Σ u_n ⊗ ∇_ξ φ_n and dF = dG A⁻¹ at every point; then (numerics of f(Q, J'), C =
// cof F)
//     dP = 2 f_Q dF + 4 f_QQ (F:dF) F + 2 f_QJ [(C:dF) F + (F:dF) C] + f_JJ (C:dF) C + f_J dC,
// and the cell's part of the product at node n is Σ w dP A⁻ᵀ ∇_ξ φ_n. The gradient operator and its transpose would be
// most of the work; the cell's mirrors take them apart (folded_gradient.h).
#if defined(VARIMESH_OPTIMISE_HESSIAN_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_OPTIMISE_HESSIAN_INL_H
#undef VARIMESH_OPTIMISE_HESSIAN_INL_H
#else
#define VARIMESH_OPTIMISE_HESSIAN_INL_H
#endif

#include <array>
#include <numeric>

#include "core/base/index.h"
#include "core/energy/table-inl.h"
#include "core/hessian/batches.h"
#include "core/hessian/cell_lanes-inl.h"
#include "core/hessian/folded_gradient-inl.h"
#include "core/hessian/linearisation-inl.h"
#include "core/hessian/node_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <class E, int d>
class VectorHessian final : public VectorLinearisation<E, d> {
  using Kept = VectorLinearisation<E, d>;
  using Kept::kEntries, Kept::kJ, Kept::kJJ, Kept::kQ, Kept::kQJ, Kept::kQQ, Kept::kW, Kept::kSides, Kept::energy_;
  using Kept::mu;
  using Gradient = FoldedLanes<d>;
  using Cells = CellLanes<d>;
  static constexpr int kTensor = tensor_size(d);

 public:
  using Kept::Kept;

  HWY_FLATTEN void node_blocks(BatchSet& set, std::int32_t b) const override {
    const int nodes = set.cells->nodes_per_cell;
    static thread_local AlignedVector<float> scratch;
    scratch.resize(static_cast<std::size_t>(nodes) * kSides * kBatch);
    for (int lane = 0; lane < kBatch; lane += static_cast<int>(hn::Lanes(FloatTag())))
      add_up_blocks(set, b, lane, scratch.data() + lane);
    for (int n = 0; n < nodes; ++n)
      for (int lane = 0; lane < kBatch; ++lane) {
        float* to = set.parts.data() + set.part_index(b * kBatch + lane, n, 2 * d);
        for (int entry = 0; entry < kSides; ++entry) to[entry] = scratch[(n * kSides + entry) * kBatch + lane];
        if (!set.left_factor.empty()) turn_block_by_left_factor(set, b, lane, to);
      }
  }

  HWY_FLATTEN void mean_tensors(const BatchSet& set, std::int32_t b, std::vector<float>& out) const override {
    const CellSet& cells = *set.cells;
    const int per_cell = cells.affine ? 1 : cells.points;
    alignas(64) float sums[kTensor * kBatch];
    for (int lane = 0; lane < kBatch; lane += static_cast<int>(hn::Lanes(FloatTag()))) {
      const KeptPoint kept(set, b, lane);
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
    // Scratch a thread: the direction of the batch's cells and then their part of the product; its components; and dG
    // and then w dP A⁻ᵀ at their points.
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
    Cells::interleave(u, nodes, set.parts.data() + set.part_index(b * kBatch, 0, d));
  }

  double add_up(const Problem& problem, const std::vector<BatchSet>& batches, const float* direction, float* product,
                std::int32_t first, std::int32_t last) const override {
    const std::array<PartsOf, kShapes> parts =
        parts_of(batches, [&](std::size_t b) { return batches[b].cells->nodes_per_cell; });
    double along[d] = {};  // a sum each, so that no addition waits for the one before
    for (std::int32_t rank = first; rank < last; ++rank) {
      const Incidence* cells = problem.incidences.data();
      const NodeVector<d> sum =
          sum_of_parts<d>(cells + problem.offsets[rank], cells + problem.offsets[rank + 1], parts);
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

 private:
  using Steps = hn::Rebind<std::int16_t, FloatTag>;

  /// What was kept of a slot of the cells in the lanes from `lane` on.
  class KeptPoint {
   public:
    HWY_INLINE KeptPoint(const BatchSet& set, std::int32_t b, int lane)
        : partials_(set.linearisation.data() + b * set.linearisation_size() + lane),
          steps_(set.deformation.data() + b * set.deformation_size() + lane),
          mean_(set.mean.data() + static_cast<std::size_t>(b) * (d * d + 1) * kBatch + lane) {}
    HWY_INLINE FloatMatrix<d> deformation(int slot) const {
      const Floats step = load(mean_ + d * d * kBatch);
      FloatMatrix<d> F;
      unrolled<d>([&](auto i) {
        unrolled<d>([&](auto j) {
          const std::int16_t* steps = steps_ + (static_cast<std::size_t>(slot) * d * d + i * d + j) * kBatch;
          const Floats count =
              hn::ConvertTo(FloatTag(), hn::PromoteTo(hn::Rebind<std::int32_t, FloatTag>(), hn::Load(Steps(), steps)));
          F.at[i][j] = hn::MulAdd(count, step, load(mean_ + (i * d + j) * kBatch));
        });
      });
      return F;
    }
    HWY_INLINE const float* partials(int slot) const {
      return partials_ + static_cast<std::size_t>(slot) * kEntries * kBatch;
    }

   private:
    const float* partials_;
    const std::int16_t* steps_;
    const float* mean_;
  };

  /// out[(n kSides + ij) kBatch] = Σ over points of T(ik, jl) ∂_k φ_n ∂_l φ_n, with T = w A⁻¹ (d²W/dF²) A⁻ᵀ at each.
  HWY_INLINE void add_up_blocks(const BatchSet& set, std::int32_t b, int lane, float* out) const {
    const FloatTag tag;
    const CellSet& cells = *set.cells;
    const int nodes = cells.nodes_per_cell, per_cell = cells.affine ? 1 : cells.points;
    const KeptPoint kept(set, b, lane);
    const float* targets = set.inverse_target.data() + static_cast<std::size_t>(b) * per_cell * d * d * kBatch + lane;
    for (int entry = 0; entry < nodes * kSides; ++entry) hn::Store(hn::Zero(tag), tag, out + entry * kBatch);
    for (int q = 0; q < cells.points; ++q) {
      FloatMatrix<d> inverse;
      inverse.load_from(targets + static_cast<std::size_t>(cells.affine ? 0 : q) * d * d * kBatch);
      alignas(64) float T[kSides * kSides * kBatch];
      point_tensor(kept.deformation(q), kept.partials(q), inverse, T);
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

  /// T(ik, jl) for i ≥ j and k ≥ l, those of k ≠ l added to their mirror image.
  HWY_INLINE void point_tensor(const FloatMatrix<d>& F, const float* partials, const FloatMatrix<d>& inverse,
                               float* T) const {
    const FloatTag tag;
    FloatMatrix<d> change[d][d];  // w dP A⁻ᵀ of dG = e_j ⊗ e_l
    unrolled<d>([&](auto j) {
      unrolled<d>([&](auto l) {
        FloatMatrix<d> dF;
        unrolled<d>(
            [&](auto i) { unrolled<d>([&](auto m) { dF.at[i][m] = i == j ? inverse.at[l][m] : hn::Zero(tag); }); });
        change[j][l] = stress_change(F, partials, dF).template times<true>(inverse);
      });
    });
    unrolled<d>([&](auto i) {
      unrolled_through(i, [&](auto j) {
        unrolled<d>([&](auto k) {
          unrolled_through(k, [&](auto l) {
            const Floats one = change[j][l].at[i][k];
            hn::Store(k == l ? one : one + change[j][k].at[i][l], tag,
                      T + (lower_index(i, j) * kSides + lower_index(k, l)) * kBatch);
          });
        });
      });
    });
  }

  /// L B L of a lower triangle.
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

  /// The vectors at a batch's nodes times their cell's left factor, in place: of a direction and, L being symmetric, of
  /// the result.
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

  /// A⁻¹ of what BatchSet::inverse_target has.
  static HWY_INLINE FloatMatrix<d> in_reference_coordinates(const BatchSet& set, const FloatMatrix<d>& inverse) {
    const double* numbers = set.gradient.directions.data();  // column-major
    FloatMatrix<d> directions;
    unrolled<d>([&](auto i) {
      unrolled<d>([&](auto j) { directions.at[i][j] = every(static_cast<float>(numbers[j * d + i])); });
    });
    return directions.transposed_times(inverse);
  }

  HWY_INLINE void add_mean(const FloatMatrix<d>& F, const float* partials, const FloatMatrix<d>& inverse,
                           Floats* M) const {
    Floats shape = load(partials + kQ * kBatch) * every(2.0F);
    if constexpr (E::kStrain != StrainTerm::None)
      shape = hn::MulAdd(load(partials + kW * kBatch), every(static_cast<float>(mu())), shape);
    const Floats volume = hn::Max(load(partials + kJJ * kBatch), hn::Zero(FloatTag()));
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

  /// Displacements are multiplied by L before they become dG: L M L in i and j.
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

  /// The components of dG become those of w dP A⁻ᵀ.
  HWY_INLINE void at_points(const BatchSet& set, std::int32_t b, int lane, float* slopes) const {
    for (const FoldedGradient::Orbit& orbit : set.gradient.point_orbits) {
      Gradient::turn(slopes, orbit);
      at_values(set, b, lane, orbit.component[0], 1 << orbit.mirrors, slopes);
      Gradient::turn(slopes, orbit);
    }
  }

  /// dG becomes w dP A⁻ᵀ in `count` slots from `first` on.
  HWY_FLATTEN HWY_NOINLINE void at_values(const BatchSet& set, std::int32_t b, int lane, int first, int count,
                                          float* slopes) const {
    const CellSet& cells = *set.cells;
    const KeptPoint kept(set, b, lane);
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
          stress_change(kept.deformation(slot), kept.partials(slot), dG.template times<false>(inverse))
              .template times<true>(inverse);
      unrolled<d>([&](auto i) {
        unrolled<d>([&](auto k) { hn::Store(out.at[i][k], FloatTag(), slope + (i * d + k) * kBatch); });
      });
    }
  }

  /// w dP of dF.
  HWY_INLINE FloatMatrix<d> stress_change(const FloatMatrix<d>& F, const float* partials,
                                          const FloatMatrix<d>& dF) const {
    const auto entry = [&](int index) { return load(partials + index * kBatch); };
    const FloatMatrix<d> C = cofactor_of<d>(F);
    const Floats dJ = C.inner(dF), two = every(2.0F);
    FloatMatrix<d> dP = cofactor_change<d>(F, dF);
    dP.scale(entry(kJ));
    Floats along_C = entry(kJJ) * dJ;
    if constexpr (E::kQuadratic == Quadratic::Deformation) {
      dP.add(two * entry(kQ), dF);
      if constexpr (E::kMixed || E::kCurved) {
        const Floats dQ = two * F.inner(dF);
        Floats along_F = hn::Zero(FloatTag());
        if constexpr (E::kMixed) {
          along_F = entry(kQJ) * dJ;
          along_C = hn::MulAdd(entry(kQJ), dQ, along_C);
        }
        if constexpr (E::kCurved) along_F = hn::MulAdd(entry(kQQ), dQ, along_F);
        dP.add(two * along_F, F);
      }
    } else {
      // Q = |C|²: dQ/dF = 2 (|F|² F − F Fᵀ F), and its change along dF.
      const FloatMatrix<d> B = F.template times<true>(F), dB = dF.template times<true>(F);  // F Fᵀ, dF Fᵀ
      const Floats square = F.inner(F), dot = F.inner(dF);
      FloatMatrix<d> slope = B.template times<false>(F);  // F Fᵀ F
      slope.scale(every(-1.0F));
      slope.add(square, F);
      const Floats dQ = two * slope.inner(dF);
      FloatMatrix<d> change = B.template times<false>(dF);
      change.add(every(1.0F), dB.template times<false>(F));
      FloatMatrix<d> dBt;
      unrolled<d>([&](auto i) { unrolled<d>([&](auto j) { dBt.at[i][j] = dB.at[j][i]; }); });
      change.add(every(1.0F), dBt.template times<false>(F));
      change.scale(every(-1.0F));
      change.add(square, dF);
      change.add(two * dot, F);
      dP.add(two * entry(kQ), change);
      if constexpr (E::kMixed) {
        dP.add(two * entry(kQJ) * dJ, slope);
        along_C = hn::MulAdd(entry(kQJ), dQ, along_C);
      }
    }
    dP.add(along_C, C);
    if constexpr (E::kStrain == StrainTerm::GreenLagrange) add_green_lagrange(entry(kW), F, dF, dP);
    if constexpr (E::kStrain == StrainTerm::Small) add_small_strain(entry(kW), dF, dP);
    return dP;
  }

  /// 2μ (dF E + F dE), E = (FᵀF − 1)/2, dE = sym(Fᵀ dF).
  HWY_INLINE void add_green_lagrange(Floats w, const FloatMatrix<d>& F, const FloatMatrix<d>& dF,
                                     FloatMatrix<d>& dP) const {
    FloatMatrix<d> twice_E = F.transposed_times(F);
    unrolled<d>([&](auto i) { twice_E.at[i][i] = twice_E.at[i][i] - every(1.0F); });
    const FloatMatrix<d> half = F.transposed_times(dF);
    FloatMatrix<d> twice_dE;
    unrolled<d>([&](auto i) { unrolled<d>([&](auto j) { twice_dE.at[i][j] = half.at[i][j] + half.at[j][i]; }); });
    const Floats w_mu = w * every(static_cast<float>(mu()));
    dP.add(w_mu, dF.template times<false>(twice_E));
    dP.add(w_mu, F.template times<false>(twice_dE));
  }

  /// 2μ sym dF, and λ tr dF 1 in the classical form.
  HWY_INLINE void add_small_strain(Floats w, const FloatMatrix<d>& dF, FloatMatrix<d>& dP) const {
    const Floats w_mu = w * every(static_cast<float>(mu()));
    Floats trace = hn::Zero(FloatTag());
    unrolled<d>([&](auto i) {
      trace = trace + dF.at[i][i];
      unrolled<d>([&](auto j) { dP.at[i][j] = hn::MulAdd(w_mu, dF.at[i][j] + dF.at[j][i], dP.at[i][j]); });
    });
    if constexpr (E::kTraceOfStrain) {
      const Floats pressure = w * every(static_cast<float>(energy_.lambda)) * trace;
      unrolled<d>([&](auto i) { dP.at[i][i] = dP.at[i][i] + pressure; });
    }
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
