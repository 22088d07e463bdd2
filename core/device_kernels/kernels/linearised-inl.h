// What is made from what a linearisation has kept, of cells of any shape: for the preconditioner the nodes' own blocks
// of a cell's Hessian and its mean tensor (HessianKernels::node_blocks, mean_tensors), and a convex part of the Hessian
// (CellEnergy::keep_convex_part).
#if defined(VARIMESH_DEVICE_LINEARISED_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_LINEARISED_INL_H
#undef VARIMESH_DEVICE_LINEARISED_INL_H
#else
#define VARIMESH_DEVICE_LINEARISED_INL_H
#endif

#include "core/base/index.h"
#include "core/device_kernels/kernels/general-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <class E, int d>
class LinearisedThread : public GeneralThread<E, d> {
  using Kept = KeptPartials<E>;
  static constexpr int kSides = triangle_size(d), kTensor = triangle_size(d * d);

 public:
  using GeneralThread<E, d>::GeneralThread;

  /// The block of a node: for a = A⁻ᵀ ∇_ξ φ_n its column j is Σ w dP a along dF = e_j ⊗ a.
  HWY_INLINE void node_block() const {
    float block[d][d] = {};
    VARIMESH_NOT_UNROLLED
    for (int point = 0; point < this->a_.points; ++point) {
      const FloatMatrix<d> inverse = this->inverse_target(point), F = kept().deformation(point);
      Floats a[d];
      VARIMESH_UNROLLED for (int m = 0; m < d; ++m) {
        float sum = 0;
        VARIMESH_UNROLLED for (int l = 0; l < d; ++l) {
          const float derivative = static_cast<float>(this->derivative_of(this->own_, point, l));
          sum = __builtin_fmaf(derivative, inverse.at[l][m].value, sum);
        }
        a[m] = Floats{sum};
      }
      VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
        FloatMatrix<d> dF;
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
          VARIMESH_UNROLLED for (int m = 0; m < d; ++m) { dF.at[i][m] = Floats{i == j ? a[m].value : 0.0F}; }
        }
        const FloatMatrix<d> dP = stress_change(this->energy_, F, kept().partials(point), dF);
        VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
          VARIMESH_UNROLLED for (int m = 0; m < d; ++m) {
            block[i][j] = __builtin_fmaf(dP.at[i][m].value, a[m].value, block[i][j]);
          }
        }
      }
    }
    write_block(block);
  }

  /// The mean tensor of a cell. With L, displacements are multiplied with it before they become dG.
  HWY_INLINE void mean_tensor() const {
    float L[d][d], L2[d][d];
    load_left_factor(L, L2);
    float M[kTensor] = {};
    VARIMESH_NOT_UNROLLED
    for (int point = 0; point < this->a_.points; ++point) {
      const FloatMatrix<d> inverse = this->inverse_target(point);
      const FloatMatrix<d> S = inverse.template times<true>(inverse);
      const FloatMatrix<d> c = cofactor_of<d>(kept().deformation(point)).template times<true>(inverse);
      const float* partials = kept().partials(point);
      float shape = 2 * partials[Kept::kQ * kBatch];
      if constexpr (E::kStrain != StrainTerm::None)
        shape = __builtin_fmaf(partials[Kept::kW * kBatch], static_cast<float>(this->energy_.mu), shape);
      const float kept_volume = partials[Kept::kJJ * kBatch], volume = kept_volume > 0 ? kept_volume : 0.0F;
      float turned[d][d];
      VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
        VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
          turned[i][k] = 0;
          VARIMESH_UNROLLED for (int m = 0; m < d; ++m) {
            turned[i][k] = __builtin_fmaf(L[i][m], c.at[m][k].value, turned[i][k]);
          }
        }
      }
      VARIMESH_UNROLLED for (int ik = 0; ik < d * d; ++ik) {
        VARIMESH_UNROLLED for (int jl = 0; jl < d * d; ++jl) {
          if (jl > ik) continue;
          float& entry = M[lower_index(ik, jl)];
          entry = __builtin_fmaf(volume * turned[ik / d][ik % d], turned[jl / d][jl % d], entry);
          entry = __builtin_fmaf(shape * L2[ik / d][jl / d], S.at[ik % d][jl % d].value, entry);
        }
      }
    }
    float* to = this->a_.tensors + (static_cast<std::int64_t>(this->batch_) * kBatch + this->lane_) * kTensor;
    VARIMESH_UNROLLED for (int entry = 0; entry < kTensor; ++entry) { to[entry] = M[entry]; }
  }

  /// Replaces what was kept of a point by a positive semidefinite part: without f_J, and with f_JJ at least λ/(J² +
  /// δ²). Only for the hyperelastic energy, whose f_Q is μ/2. The nodes must be where they were linearised.
  HWY_INLINE void keep_convex_part() const {
    float* partials = this->a_.linearisation + this->at_point(this->own_, Kept::kEntries);
    const double J = determinant<d>(this->deformation_of_shape()).value;
    const double weight = 2 * static_cast<double>(partials[Kept::kQ * kBatch]) / this->a_.material.mu;
    const double size = J * J + this->delta_squared().value;
    const float least = static_cast<float>(weight * this->a_.material.lambda / size);
    partials[Kept::kJ * kBatch] = 0;
    if (least > partials[Kept::kJJ * kBatch]) partials[Kept::kJJ * kBatch] = least;
  }

 private:
  HWY_INLINE KeptPoints<d> kept() const { return this->kept_points(); }

  /// L and L², which are 1 if there is no L.
  HWY_INLINE void load_left_factor(float (&L)[d][d], float (&L2)[d][d]) const {
    const double* factor = this->left_factor();
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
        L[i][j] = factor == nullptr ? (i == j ? 1.0F : 0.0F) : static_cast<float>(factor[(i * d + j) * kBatch]);
      }
    }
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
        L2[i][j] = 0;
        VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { L2[i][j] = __builtin_fmaf(L[i][k], L[j][k], L2[i][j]); }
      }
    }
  }

  /// Writes the lower triangle of L B L, and the p-norm's own term with it.
  HWY_INLINE void write_block(const float (&block)[d][d]) const {
    float L[d][d], unused[d][d], half[d][d];
    load_left_factor(L, unused);
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
        half[i][j] = 0;
        VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { half[i][j] = __builtin_fmaf(L[i][k], block[k][j], half[i][j]); }
      }
    }
    const std::int64_t node = this->cell_node();
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
        if (j > i) continue;
        float sum = 0;
        VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum = __builtin_fmaf(half[i][k], L[j][k], sum); }
        if (this->a_.cell_gradients != nullptr) {
          const float* g = this->a_.cell_gradients + node * d;
          sum = __builtin_fmaf(g[i], g[j], sum);
        }
        this->a_.contributions[node * kSides + lower_index(i, j)] = sum;
      }
    }
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
