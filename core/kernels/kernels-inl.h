// The vectorised kernels: one quadrature point per vector lane. F is affine in the one node that moves.
//
// Moving a node by a changes F to F + a ⊗ g with g = A⁻ᵀ ∇_ξ φ. J becomes exactly J + a·c with c = C g (C = cof F), and
// the first and second derivatives of the invariants in a need only y = F g, c and a few products of them; no matrix of
// derivatives is applied. With f(Q, J') of the energy, weights w and Q = |F|²:
//     gradient  Σ w (2 f_Q y + f_J c)
//     Hessian   Σ w (2 f_Q |g|² 1 + 4 f_QQ y yᵀ + 2 f_QJ (c yᵀ + y cᵀ) + f_JJ c cᵀ)
// For Q = |C|² replace 2 y by k = 2 (|F|² y − F Fᵀ y) and 2 |g|² 1 by 2 [y yᵀ + (|F|² |g|² − |y|²) 1 − |g|² F Fᵀ].
#if defined(VARIMESH_KERNELS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_KERNELS_INL_H
#undef VARIMESH_KERNELS_INL_H
#else
#define VARIMESH_KERNELS_INL_H
#endif

#include <limits>
#include <vector>

#include "core/base/index.h"
#include "core/energy/table-inl.h"
#include "core/kernels/deformation_lanes-inl.h"
#include "core/kernels/kernels.h"
#include "core/kernels/left_factor.h"
#include "core/kernels/line_lanes-inl.h"
#include "core/kernels/strain_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// What does not depend on the energy. It is compiled once for each dimension, and what does once for each energy.
template <int d>
class KernelsOfAnyEnergy : public Kernels {
 public:
  int line_size() const override { return properties_.function_at() + (properties_.keeps_function ? 1 : 0); }
  bool keeps_function() const override { return properties_.keeps_function; }

  HWY_FLATTEN void move(std::span<const StarCell> star, const double* step) const override {
    double turned[d];
    for (const StarCell& cell : star) {
      times_left_factor(cell.left_factor, d, step, turned);
      Lanes a[d];
      unrolled<d>([&](auto i) { a[i] = hn::Set(Tag(), turned[i]); });
      for (int q = 0; q < cell.stride; q += static_cast<int>(hn::Lanes(Tag()))) {
        Lanes g[d];
        if (properties_.has_line && cell.line != nullptr)
          Line<d>::gradient(cell, q, g);
        else
          cell.affine ? node_gradient<d, true>(cell, q, g) : node_gradient<d, false>(cell, q, g);
        unrolled<d>([&](auto i) {
          unrolled<d>([&](auto j) {
            double* at = cell.deformation + (i * d + j) * cell.stride + q;
            hn::Store(hn::MulAdd(a[i], g[j], load(at)), Tag(), at);
          });
        });
      }
      if (properties_.keeps_function && cell.jacobian_function != nullptr) move_function(cell);
    }
  }

  double smallest_jacobian(std::span<const StarCell> star) const override {
    Lanes smallest = hn::Set(Tag(), std::numeric_limits<double>::infinity());
    for (const StarCell& cell : star)
      for (int q = 0; q < cell.stride; q += static_cast<int>(hn::Lanes(Tag()))) {
        Gradient<d> at;
        at.load_from(cell.deformation, cell.stride, q);
        smallest = hn::Min(smallest, at.determinant());
      }
    return min_of(smallest);
  }

  HWY_FLATTEN void deform(const CellSet& set, std::int32_t cell, std::span<const double> positions,
                          double* F) const override {
    const std::int32_t* nodes = set.nodes.data() + static_cast<std::size_t>(cell) * set.nodes_per_cell;
    const double *inverse = set.inverse_target_of(cell), *factor = set.left_factor_of(cell);
    static thread_local std::vector<double> turned;  // L x
    turned.resize(static_cast<std::size_t>(set.nodes_per_cell) * d);
    for (int n = 0; n < set.nodes_per_cell; ++n)
      times_left_factor(factor, d, positions.data() + static_cast<std::size_t>(nodes[n]) * d, &turned[n * d]);
    for (int q = 0; q < set.stride; q += static_cast<int>(hn::Lanes(Tag()))) {
      Lanes G[d][d];  // L ∇_ξ χ_M
      unrolled<d * d>([&](auto i) { G[i / d][i % d] = zero(); });
      for (int n = 0; n < set.nodes_per_cell; ++n) {
        const double* x = turned.data() + n * d;
        const double* table = set.derivatives_of(n) + q;
        unrolled<d>([&](auto k) {
          const Lanes slope = load(table + k * set.stride);
          unrolled<d>([&](auto i) { G[i][k] = hn::MulAdd(hn::Set(Tag(), x[i]), slope, G[i][k]); });
        });
      }
      unrolled<d>([&](auto i) {
        unrolled<d>([&](auto j) {
          Lanes entry = zero();
          unrolled<d>([&](auto k) {
            const Lanes a =
                set.affine ? hn::Set(Tag(), inverse[k * d + j]) : load(inverse + (k * d + j) * set.stride + q);
            entry = hn::MulAdd(G[i][k], a, entry);
          });
          hn::Store(entry, Tag(), F + (i * d + j) * set.stride + q);
        });
      });
    }
  }

 protected:
  struct Properties {
    bool has_line, keeps_function, has_barrier;  ///< As in VectorKernels.
    /// Where StarCell::line keeps the function of J of the last energy_after(), by points; the Line comes before it.
    int function_at() const { return has_line ? Line<d>::kSize : 0; }
  };
  explicit KernelsOfAnyEnergy(const Properties& properties) : properties_(properties) {}

  double* function_after(const StarCell& cell) const { return cell.line + properties_.function_at() * cell.stride; }

 private:
  HWY_INLINE void move_function(const StarCell& cell) const {
    const bool is_plain = properties_.has_barrier && cell.delta_squared == 0;
    if (!is_plain || cell.line == nullptr) return take_function(cell.deformation, cell.stride, cell.jacobian_function);
    for (int q = 0; q < cell.stride; q += static_cast<int>(hn::Lanes(Tag())))
      hn::Store(load(function_after(cell) + q), Tag(), cell.jacobian_function + q);
  }

  const Properties properties_;
};

/// The kernels of one energy in one dimension. Kernels says what each function does.
template <class E, int d>
class VectorKernels final : public KernelsOfAnyEnergy<d> {
  static constexpr int kEntries = d * (d + 1) / 2;
  static constexpr double kHuge = 1e100;  // a J or an energy beyond this counts as not finite

 public:
  explicit VectorKernels(const E& energy)
      : KernelsOfAnyEnergy<d>({kHasLine, kKeepsFunction, E::kBarrier}), energy_(energy) {}

  HWY_FLATTEN StarExpansion expand(std::span<const StarCell> star) const override {
    Sums<d> sums;
    for (const StarCell& cell : star) {
      // Drops the sums so far. Looking for such cells first would cost every star a loop.
      if (cell.left_factor != nullptr) return expand_through_left_factors(*this, d, star);
      if (is_plain(cell))
        cell.affine ? expand_cell<true, true>(cell, sums) : expand_cell<false, true>(cell, sums);
      else
        cell.affine ? expand_cell<true, false>(cell, sums) : expand_cell<false, false>(cell, sums);
    }
    StarExpansion out;
    out.energy = sum_of(sums.energy);
    out.measure = sum_of(sums.measure);
    unrolled<d>([&](auto i) { out.gradient[i] = sum_of(sums.gradient[i]); });
    unrolled<kEntries>([&](auto i) { out.hessian[i] = sum_of(sums.hessian[i]); });
    return out;
  }

  HWY_FLATTEN double energy_after(std::span<const StarCell> star, const double* step) const override {
    Lanes a[d];
    unrolled<d>([&](auto i) { a[i] = hn::Set(Tag(), step[i]); });
    Lanes sum = zero();
    for (const StarCell& cell : star) {
      if (cell.left_factor != nullptr) return energy_through_left_factors(*this, d, star, step);
      bool allowed = false;
      if (kHasLine && cell.line != nullptr)
        allowed = is_plain(cell) ? add_energy_on_line<true>(cell, a, sum) : add_energy_on_line<false>(cell, a, sum);
      else if (is_plain(cell))
        allowed =
            cell.affine ? add_energy_after<true, true>(cell, a, sum) : add_energy_after<false, true>(cell, a, sum);
      else
        allowed =
            cell.affine ? add_energy_after<true, false>(cell, a, sum) : add_energy_after<false, false>(cell, a, sum);
      if (!allowed) return std::numeric_limits<double>::infinity();
    }
    const double energy = sum_of(sum);
    return energy < kHuge ? energy : std::numeric_limits<double>::infinity();
  }

  void take_function(const double* F, int stride, double* function) const override {
    for (int q = 0; q < stride; q += static_cast<int>(hn::Lanes(Tag()))) {
      Gradient<d> at;
      at.load_from(F, stride, q);
      hn::Store(jacobian_function<E::kFunction>(at.determinant()), Tag(), function + q);
    }
  }

  HWY_FLATTEN CellScan scan(const CellSet& set, std::int32_t cell, const double* F,
                            const double* function) const override {
    const bool plain = E::kBarrier && set.delta_squared[cell] == 0;
    if (set.affine)
      return plain ? scan_cell<true, true>(set, cell, F, function) : scan_cell<true, false>(set, cell, F, function);
    return plain ? scan_cell<false, true>(set, cell, F, function) : scan_cell<false, false>(set, cell, F, function);
  }

 private:
  /// Whether J' = J at every point. The root and the division of the general case take as long as the rest. J stays
  /// positive only with a barrier.
  static bool is_plain(const StarCell& cell) { return E::kBarrier && cell.delta_squared == 0; }

  static constexpr bool kKeepsFunction = E::kFunction != JacobianFunction::None;
  /// Whether the energy depends on F only through J and |F|².
  static constexpr bool kHasLine = E::kQuadratic == Quadratic::Deformation && E::kStrain == StrainTerm::None;

  /// J' at the points from q on. `function`: the function of J that is kept; null: it is evaluated here.
  template <bool plain>
  static HWY_INLINE Regularised<Lanes> jacobian_if(Lanes J, double delta_squared, const double* function, int q) {
    if constexpr (!plain) return regularised<E::kFunction>(J, hn::Set(Tag(), delta_squared));
    if (kKeepsFunction && function != nullptr) return {J, J, J, load(function + q)};
    return {J, J, J, jacobian_function<E::kFunction>(J)};
  }

  /// W(F).
  HWY_INLINE Lanes value(const Gradient<d>& at, const Regularised<Lanes>& j) const {
    Lanes Q = at.square();
    if constexpr (E::kQuadratic == Quadratic::Cofactor) {
      Q = zero();
      unrolled<d>([&](auto i) {
        Lanes C[d];
        at.cofactor_row(i, C);
        unrolled<d>([&](auto k) { Q = hn::MulAdd(C[k], C[k], Q); });
      });
    }
    Lanes W = energy_.value(Q, j);
    if constexpr (E::kStrain != StrainTerm::None) W = W + strain_value(energy_, at);
    return W;
  }

  template <bool affine, bool plain>
  HWY_INLINE CellScan scan_cell(const CellSet& set, std::int32_t cell, const double* F, const double* function) const {
    const double infinity = std::numeric_limits<double>::infinity();
    Lanes energy = zero(), smallest = hn::Set(Tag(), infinity), largest = hn::Set(Tag(), -infinity);
    Lanes low = smallest, high = largest;  // of det ∇χ_M = J |det A|, if |det A| varies
    for (int q = 0; q < set.stride; q += static_cast<int>(hn::Lanes(Tag()))) {
      Gradient<d> at;
      at.load_from(F, set.stride, q);
      const Lanes J = at.determinant(), weights = load(set.weights.data() + q);
      const Lanes w = affine ? weights * hn::Set(Tag(), set.measure_of(cell)[0]) : load(set.measure_of(cell) + q);
      smallest = hn::Min(smallest, J);
      largest = hn::Max(largest, J);
      if constexpr (!affine) {
        const auto real = hn::Gt(weights, zero());
        const Lanes volume = J * w / hn::Max(weights, hn::Set(Tag(), std::numeric_limits<double>::min()));
        low = hn::Min(low, hn::IfThenElse(real, volume, low));
        high = hn::Max(high, hn::IfThenElse(real, volume, high));
      }
      const auto j = jacobian_if<plain>(J, set.delta_squared[cell], function, q);
      energy = hn::MulAdd(w, value(at, j), energy);
    }
    CellScan out;
    out.energy = sum_of(energy);
    out.smallest_jacobian = min_of(smallest);
    // The padding repeats the last point.
    const double lowest = affine ? out.smallest_jacobian : min_of(low), highest = max_of(affine ? largest : high);
    out.scaled_jacobian = highest > 0 && lowest / highest > -1 ? lowest / highest : -1.0;
    return out;
  }

  template <bool plain>
  HWY_INLINE bool add_energy_on_line(const StarCell& cell, const Lanes* a, Lanes& sum) const {
    const Lanes lowest = hn::Set(Tag(), E::kBarrier && cell.delta_squared == 0 ? 0.0 : -kHuge);
    const Lanes huge = hn::Set(Tag(), kHuge), aa = inner<d>(a, a);
    const int width = static_cast<int>(hn::Lanes(Tag()));
    for (int q = 0; q < cell.stride; q += width) {
      Lanes J, Q;
      Line<d>::after(cell, q, a, aa, J, Q);
      if (!hn::AllTrue(Tag(), hn::And(hn::Gt(J, lowest), hn::Lt(J, huge)))) return false;
      const Lanes w = cell.affine ? weight<true>(cell, q) : weight<false>(cell, q);
      const auto j = jacobian_if<plain>(J, cell.delta_squared, nullptr, q);
      if constexpr (plain && kKeepsFunction) hn::Store(j.function, Tag(), this->function_after(cell) + q);
      sum = hn::MulAdd(w, energy_.value(Q, j), sum);
    }
    return true;
  }

  template <bool affine, bool plain>
  HWY_INLINE bool add_energy_after(const StarCell& cell, const Lanes* a, Lanes& sum) const {
    // logarithm() returns a finite number even for J ≤ 0, so J is tested first.
    const Lanes lowest = hn::Set(Tag(), E::kBarrier && cell.delta_squared == 0 ? 0.0 : -kHuge);
    const Lanes huge = hn::Set(Tag(), kHuge);
    for (int q = 0; q < cell.stride; q += static_cast<int>(hn::Lanes(Tag()))) {
      Lanes g[d];
      node_gradient<d, affine>(cell, q, g);
      Gradient<d> at;
      at.load_from(cell.deformation, cell.stride, q);
      unrolled<d>([&](auto i) { unrolled<d>([&](auto j) { at.F[i][j] = hn::MulAdd(a[i], g[j], at.F[i][j]); }); });
      const Lanes J = at.determinant();
      if (!hn::AllTrue(Tag(), hn::And(hn::Gt(J, lowest), hn::Lt(J, huge)))) return false;
      const auto j = jacobian_if<plain>(J, cell.delta_squared, nullptr, q);
      if constexpr (plain && kKeepsFunction)
        if (cell.line != nullptr) hn::Store(j.function, Tag(), this->function_after(cell) + q);
      sum = hn::MulAdd(weight<affine>(cell, q), value(at, j), sum);
    }
    return true;
  }

  template <bool affine, bool plain>
  HWY_INLINE void expand_cell(const StarCell& cell, Sums<d>& sums) const {
    for (int q = 0; q < cell.stride; q += static_cast<int>(hn::Lanes(Tag()))) {
      Lanes g[d], y[d], c[d];
      node_gradient<d, affine>(cell, q, g);
      Gradient<d> at;
      at.load_from(cell.deformation, cell.stride, q);
      at.times(g, y);
      Lanes J = zero(), cofactor_square = zero();
      unrolled<d>([&](auto i) {
        Lanes C[d];
        at.cofactor_row(i, C);
        c[i] = inner<d>(C, g);
        if (i == 0) J = inner<d>(C, at.F[0]);
        if constexpr (E::kQuadratic == Quadratic::Cofactor) cofactor_square = cofactor_square + inner<d>(C, C);
      });
      const Lanes w = weight<affine>(cell, q);
      const Lanes square = at.square(), gg = inner<d>(g, g);
      if (kHasLine && cell.line != nullptr) Line<d>::keep(cell, q, J, square, gg, c, y, g);
      const auto j = jacobian_if<plain>(J, cell.delta_squared, cell.jacobian_function, q);
      add_invariants(at, j, square, cofactor_square, w, gg, y, c, sums);
      if constexpr (E::kStrain == StrainTerm::GreenLagrange) add_green_lagrange(energy_, at, w, gg, y, sums);
      if constexpr (E::kStrain == StrainTerm::Small) add_small_strain(energy_, at, w, g, gg, sums);
      sums.measure = sums.measure + w;
    }
  }

  /// Adds f(Q, J') and its derivatives.
  HWY_INLINE void add_invariants(const Gradient<d>& at, const Regularised<Lanes>& j, Lanes square,
                                 Lanes cofactor_square, Lanes w, Lanes gg, const Lanes* y, const Lanes* c,
                                 Sums<d>& sums) const {
    constexpr bool cofactor = E::kQuadratic == Quadratic::Cofactor;
    const Partials<Lanes> p = energy_.partials(cofactor ? cofactor_square : square, j);
    const Lanes two = hn::Set(Tag(), 2.0);
    const Lanes w_Q = w * p.f_Q, w_J = w * p.f_J, w_JJ = w * p.f_JJ;
    Lanes k[d], B[kEntries];  // k: gradient of Q in the node's displacement
    unrolled<d>([&](auto i) { k[i] = two * y[i]; });
    if constexpr (cofactor) {
      at.left_product(B);
      unrolled<d>([&](auto i) {
        Lanes By = zero();
        unrolled<d>([&](auto m) { By = hn::MulAdd(B[symmetric_index(i, m)], y[m], By); });
        k[i] = two * hn::MulSub(square, y[i], By);
      });
    }
    sums.energy = hn::MulAdd(w, p.f, sums.energy);
    const Lanes yy = cofactor ? inner<d>(y, y) : zero();
    unrolled<d>([&](auto i) {
      sums.gradient[i] = hn::MulAdd(w_Q, k[i], hn::MulAdd(w_J, c[i], sums.gradient[i]));
      Lanes row = w_JJ * c[i];
      if constexpr (E::kMixed) row = hn::MulAdd(w * p.f_QJ, k[i], row);
      unrolled_through(i, [&](auto m) {
        const int entry = lower_index(i, m);
        Lanes h = hn::MulAdd(row, c[m], sums.hessian[entry]);
        if constexpr (E::kMixed) h = hn::MulAdd(w * p.f_QJ * c[i], k[m], h);
        if constexpr (E::kCurved) h = hn::MulAdd(w * p.f_QQ * k[i], k[m], h);
        if constexpr (cofactor) {
          Lanes q = hn::NegMulAdd(gg, B[entry], y[i] * y[m]);
          if (i == m) q = q + hn::MulSub(square, gg, yy);
          h = hn::MulAdd(two * w_Q, q, h);
        } else if (i == m) {
          h = hn::MulAdd(two * w_Q, gg, h);
        }
        sums.hessian[entry] = h;
      });
    });
  }

  E energy_;
};

/// The kernels of the material's energy; the caller owns them.
template <int d>
Kernels* new_kernels(const Material& material) {
  return with_energy<d>(material,
                        [](auto energy) -> Kernels* { return new VectorKernels<decltype(energy), d>(energy); });
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
