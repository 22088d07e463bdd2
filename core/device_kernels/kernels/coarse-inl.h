// The coarse level of the preconditioner (core/preconditioner/coarse_level.h): its matrix, its cycle, and the way from
// the free nodes to it and back.
#if defined(VARIMESH_DEVICE_COARSE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_COARSE_INL_H
#undef VARIMESH_DEVICE_COARSE_INL_H
#else
#define VARIMESH_DEVICE_COARSE_INL_H
#endif

#include "core/device_kernels/kernels/blocks-inl.h"
#include "core/device_kernels/kernels/parts-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

using device::CoarseArguments;
using device::kRowParts;

/// Numbers per node of padded vectors.
template <int d>
inline constexpr int kPadded = d == 2 ? 2 : 4;
inline constexpr float kSteps = 32767;  ///< Of the matrix: kLargestFixedPoint.

// ===== The matrix =====

/// The block of a cell between its coarse nodes a and b: CoarseLevel::stiffness().
template <int d>
HWY_INLINE void add_stiffness(const device::CoarseSet& set, std::int32_t cell, int a, int b, double (&K)[d][d]) {
  constexpr int kTensor = triangle_size(d * d);
  const float* M = set.tensors + static_cast<std::int64_t>(cell) * kTensor;
  const float* means = set.stiffness + (static_cast<std::int64_t>(a) * set.nodes_per_cell + b) * (d * d);
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        VARIMESH_UNROLLED for (int l = 0; l < d; ++l) {
          K[i][j] = __builtin_fma(static_cast<double>(M[symmetric_index(i * d + k, j * d + l)]),
                                  static_cast<double>(means[k * d + l]), K[i][j]);
        }
      }
    }
  }
}

/// L⁻¹ of the diagonal block of a node, with its diagonal raised; 0 if there is none.
template <int d>
HWY_INLINE void factorise_diagonal(const CoarseArguments& a, std::int64_t node) {
  if (node >= a.nodes) return;
  double K[d][d] = {};
  for (std::int64_t p = a.cell_begin[node]; p < a.cell_begin[node + 1]; ++p) {
    const device::CellOfNode in = a.cells[p];
    add_stiffness<d>(a.sets[in.set], in.cell, in.local, in.local, K);
  }
  double trace = 0, square = 0, inverse[d][d];
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { trace = trace + K[i][i]; }
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { K[i][i] = __builtin_fma(1e-6, trace, K[i][i]); }
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) { square = __builtin_fma(K[i][j], K[i][j], square); }
  }
  bool is_usable = inverse_of_factor<d>(K, inverse) && __builtin_sqrt(square) >= kNothing;
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) { is_usable = is_usable && inverse[i][j] - inverse[i][j] == 0; }
  }
  VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      a.inverse_factor[node * (d * d) + j * d + i] = is_usable ? static_cast<float>(inverse[i][j]) : 0.0F;
    }
  }
}

/// Entry (i, j) of L⁻¹ of a node.
template <int d>
HWY_INLINE float inverse_factor(const CoarseArguments& a, std::int64_t node, int i, int j) {
  return a.inverse_factor[node * (d * d) + j * d + i];
}

/// One block of the matrix: L_i⁻¹ K_ij L_j⁻ᵀ in steps.
template <int d>
HWY_INLINE void assemble_block(const CoarseArguments& a, std::int64_t block) {
  if (block >= a.blocks) return;
  const std::int32_t row = a.row[block], column = a.column[block];
  double K[d][d] = {}, half[d][d];
  for (std::int64_t p = a.cell_begin[row]; p < a.cell_begin[row + 1]; ++p) {
    const device::CellOfNode in = a.cells[p];
    const device::CoarseSet& set = a.sets[in.set];
    const std::int32_t* nodes = set.nodes + static_cast<std::int64_t>(in.cell) * set.nodes_per_cell;
    for (int b = 0; b < set.nodes_per_cell; ++b)
      if (nodes[b] == column) add_stiffness<d>(set, in.cell, in.local, b, K);
  }
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
      half[i][j] = 0;
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        if (k <= i)
          half[i][j] = __builtin_fma(static_cast<double>(inverse_factor<d>(a, row, i, k)), K[k][j], half[i][j]);
      }
    }
  }
  VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      double sum = 0;
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        if (k <= j) sum = __builtin_fma(half[i][k], static_cast<double>(inverse_factor<d>(a, column, j, k)), sum);
      }
      const double steps = static_cast<double>(kSteps) * sum, most = static_cast<double>(kSteps);
      const double limited = steps > most ? most : steps < -most ? -most : steps;
      a.entry[block * (d * d) + j * d + i] = static_cast<std::int16_t>(__builtin_rint(limited));
    }
  }
}

// ===== From the free nodes to the coarse nodes =====

/// The residual of a node over the number of its cells.
template <int d>
HWY_INLINE void share_residual(const device::NodeArguments& a, std::int64_t node) {
  if (node >= a.nodes) return;
  const float share = 1 / static_cast<float>(a.offsets[node + 1] - a.offsets[node]);
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.shared[node * d + k] = share * a.residual[node * d + k]; }
}

/// The restriction of a cell to one of its coarse nodes.
template <int d>
HWY_INLINE void restrict_cell(const device::RestrictArguments& a, std::int64_t thread) {
  const std::int64_t batch = thread / kBatch / a.coarse;
  if (batch >= a.batches) return;
  const int own = static_cast<int>(thread / kBatch % a.coarse), lane = static_cast<int>(thread % kBatch);
  float sum[d] = {};
  for (std::int64_t e = a.begin[own]; e < a.begin[own + 1]; ++e) {
    const std::int32_t rank = a.ranks[(batch * a.nodes + a.column[e]) * kBatch + lane];
    const float* from = a.values + static_cast<std::int64_t>(rank) * d;
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum[k] = __builtin_fmaf(a.factor[e], from[k], sum[k]); }
  }
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.contributions[thread * d + k] = sum[k]; }
}

/// The right side at a coarse node: L⁻¹ times the sum over its cells.
template <int d>
HWY_INLINE void add_up_coarse(const CoarseArguments& a, std::int64_t node) {
  if (node >= a.nodes) return;
  float sum[d] = {};
  for (std::int64_t p = a.cell_begin[node]; p < a.cell_begin[node + 1]; ++p) {
    const float* from = a.contributions + a.places[p] * d;
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum[k] = sum[k] + from[k]; }
  }
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    float out = 0;
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
      if (k <= i) out = __builtin_fmaf(inverse_factor<d>(a, node, i, k), sum[k], out);
    }
    a.right[node * kPadded<d> + i] = out;
  }
}

// ===== The cycle: Gauss–Seidel, one colour after another =====

/// One row of the matrix for kRowParts threads, and its sum with x over the blocks that `takes(column)` chooses.
template <int d>
struct CoarseRow {
  std::int32_t row;
  int first;    ///< The first part that is here.
  bool exists;  ///< A thread without a row still exchanges numbers.

  static HWY_INLINE CoarseRow of(const CoarseArguments& a, std::int64_t thread) {
    const std::int64_t row = a.first + (kOnDevice ? thread / kRowParts : thread);
    return {static_cast<std::int32_t>(row), kOnDevice ? static_cast<int>(thread % kRowParts) : 0, row < a.last};
  }
  template <class Takes>
  HWY_INLINE void sum(const CoarseArguments& a, const Takes& takes, float (&total)[d]) const {
    float sums[d][kHere<kRowParts>];
    const std::int64_t begin = exists ? a.begin[row] : 0, end = exists ? a.begin[row + 1] : 0;
    for (int p = 0; p < kHere<kRowParts>; ++p) {
      VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { sums[i][p] = 0; }
      for (std::int64_t e = begin + first + p; e < end; e += kRowParts) {
        const std::int32_t column = a.column[e];
        if (!takes(column)) continue;
        VARIMESH_UNROLLED for (int j = 0; j < d; ++j) {
          const float x = a.x[static_cast<std::int64_t>(column) * kPadded<d> + j];
          VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
            sums[i][p] = __builtin_fmaf(static_cast<float>(a.entry[e * (d * d) + j * d + i]), x, sums[i][p]);
          }
        }
      }
    }
    VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
      over_parts<kRowParts>(sums[i], [](float one, float two) { return one + two; });
      total[i] = sums[i][0];
    }
  }
  HWY_INLINE bool writes() const { return exists && first == 0; }
};

/// x_i = right_i − Σ K_ij x_j over all j ≠ i, or over j < i: before that x is 0.
template <int d, bool all>
HWY_INLINE void relax_row(const CoarseArguments& a, std::int64_t thread) {
  const auto own = CoarseRow<d>::of(a, thread);
  float sum[d];
  own.sum(
      a, [&](std::int32_t column) __attribute__((always_inline)) { return all || column < own.row; }, sum);
  if (!own.writes()) return;
  const std::int64_t at = static_cast<std::int64_t>(own.row) * kPadded<d>;
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { a.x[at + i] = __builtin_fmaf(-1 / kSteps, sum[i], a.right[at + i]); }
}

template <int d>
HWY_INLINE void relax_first(const CoarseArguments& a, std::int64_t thread) {
  relax_row<d, false>(a, thread);
}
template <int d>
HWY_INLINE void relax_last(const CoarseArguments& a, std::int64_t thread) {
  relax_row<d, true>(a, thread);
}

/// The residual after relax_first(), in the scale of K: L_i times −Σ K_ij x_j over j > i.
template <int d>
HWY_INLINE void coarse_residual(const CoarseArguments& a, std::int64_t thread) {
  const auto own = CoarseRow<d>::of(a, thread);
  float r[d];
  own.sum(
      a, [&](std::int32_t column) __attribute__((always_inline)) { return column > own.row; }, r);
  if (!own.writes()) return;
  // L r = v: L⁻¹ v = r, forward.
  float v[d];
  const bool is_there = inverse_factor<d>(a, own.row, 0, 0) != 0;
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    float sum = r[i] * (-1 / kSteps);
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
      if (k < i) sum = __builtin_fmaf(-inverse_factor<d>(a, own.row, i, k), v[k], sum);
    }
    v[i] = is_there ? sum / inverse_factor<d>(a, own.row, i, i) : 0.0F;
  }
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    a.residual[static_cast<std::int64_t>(own.row) * kPadded<d> + i] = v[i];
  }
}

/// The residual at a vertex.
template <int d>
HWY_INLINE void restrict_to_vertex(const CoarseArguments& a, std::int64_t vertex) {
  if (vertex >= a.vertices) return;
  double sum[d] = {};
  for (std::int64_t e = a.below_begin[vertex]; e < a.below_begin[vertex + 1]; ++e) {
    const float* from = a.residual + static_cast<std::int64_t>(a.below_column[e]) * kPadded<d>;
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
      sum[k] = __builtin_fma(static_cast<double>(a.below_factor[e]), static_cast<double>(from[k]), sum[k]);
    }
  }
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.linear_right[vertex * d + k] = sum[k]; }
}

/// Adds the solution of order 1, in the scale of x, at a coarse node: L_iᵀ times it.
template <int d>
HWY_INLINE void correct_from_vertices(const CoarseArguments& a, std::int64_t node) {
  if (node >= a.nodes) return;
  float sum[d] = {}, v[d];
  for (std::int64_t e = a.above_begin[node]; e < a.above_begin[node + 1]; ++e) {
    const double* from = a.linear_solution + static_cast<std::int64_t>(a.above_column[e]) * d;
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
      sum[k] = sum[k] + static_cast<float>(static_cast<double>(a.above_factor[e]) * from[k]);
    }
  }
  const bool is_there = inverse_factor<d>(a, node, 0, 0) != 0;
  VARIMESH_UNROLLED for (int back = 0; back < d; ++back) {
    const int i = d - 1 - back;
    float rest = sum[i];
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
      if (k > i) rest = __builtin_fmaf(-inverse_factor<d>(a, node, k, i), v[k], rest);
    }
    v[i] = is_there ? rest / inverse_factor<d>(a, node, i, i) : 0.0F;
  }
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.x[node * kPadded<d> + k] = a.x[node * kPadded<d> + k] + v[k]; }
}

/// x ← L⁻ᵀ x
template <int d>
HWY_INLINE void unscale(const CoarseArguments& a, std::int64_t node) {
  if (node >= a.nodes) return;
  float out[d];
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) {
    out[i] = 0;
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
      if (k >= i) out[i] = __builtin_fmaf(inverse_factor<d>(a, node, k, i), a.x[node * kPadded<d> + k], out[i]);
    }
  }
  VARIMESH_UNROLLED for (int i = 0; i < d; ++i) { a.x[node * kPadded<d> + i] = out[i]; }
}

// ===== Back to the free nodes =====

/// z = B r, and the coarse solution, at a node. Returns its part of r · z.
template <int d>
HWY_INLINE double precondition(const device::NodeArguments& a, std::int64_t node) {
  if (node >= a.nodes) return 0;
  float z[d] = {}, r[d];
  if (a.coarse != nullptr) {
    const device::CellOfNode in = a.first_cell[node];
    const device::CoarseSet& set = a.sets[in.set];
    const std::int32_t* nodes = set.nodes + static_cast<std::int64_t>(in.cell) * set.nodes_per_cell;
    for (std::int64_t e = set.value_begin[in.local]; e < set.value_begin[in.local + 1]; ++e) {
      const std::int64_t from = nodes[set.value_column[e]];
      if (from < 0) continue;
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
        z[k] = __builtin_fmaf(set.value_factor[e], a.coarse[from * kPadded<d> + k], z[k]);
      }
    }
  }
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { r[k] = a.residual[node * d + k]; }
  double along = 0;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    VARIMESH_UNROLLED for (int l = 0; l < d; ++l) {
      z[k] = __builtin_fmaf(a.inverse[node * triangle_size(d) + symmetric_index(k, l)], r[l], z[k]);
    }
    a.product[node * d + k] = z[k];
    along = __builtin_fma(static_cast<double>(z[k]), static_cast<double>(r[k]), along);
  }
  return along;
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
