// The preconditioner's loops, compiled once for each instruction set. A lane is a component of a node's vector, since
// longer vectors would have to gather. Only in restrict_cells is a lane a cell.
#include "core/preconditioner/coarse_kernels.h"

#include <algorithm>

#include "core/kernels/hessian/fixed_point_16.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/preconditioner/coarse_kernels.cpp"
#include <hwy/foreach_target.h>
// Highway needs these includes after foreach_target.h.
#include <hwy/highway.h>

#include "core/kernels/hessian/cell_lanes-inl.h"
#include "core/kernels/hessian/node_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <int d>
class VectorCoarseKernels final : public CoarseKernels {
  static constexpr int kNode = padded(d);
  using Node = NodeVector<d>;

  /// A sum kept as d columns, so that an addition need not wait for the one before.
  struct Sum {
    Node column[3];
    HWY_INLINE Sum() : column{Node::zero(), Node::zero(), Node::zero()} {}
    /// += K x, where K is d columns of d numbers. In 3-D the number after a column goes into the sum's unused fourth
    /// one.
    template <class Number>
    HWY_INLINE void add(const Number* K, const float* x) {
      column[0] = column[0].plus(x[0], Node::load(K));
      column[1] = column[1].plus(x[1], Node::load(K + d));
      if constexpr (d == 3) column[2] = column[2].plus(x[2], Node::load(K + 2 * d));
    }
    HWY_INLINE Node total() const { return column[0] + (column[1] + column[2]); }
  };

  /// Σ K_ij x_j over a row's entries from `begin` to `end`, in the steps of the matrix.
  static HWY_INLINE Node times_x(const BlockRows& rows, std::int64_t begin, std::int64_t end) {
    Sum sum;
    for (std::int64_t e = begin; e < end; ++e)
      sum.add(rows.entry + e * d * d, rows.x + static_cast<std::ptrdiff_t>(rows.column[e]) * kNode);
    return sum.total();
  }

 public:
  void forward(const BlockRows& rows, std::int32_t first, std::int32_t last) const override {
    for (std::ptrdiff_t i = first; i < last; ++i) {
      const std::int32_t* before = std::lower_bound(rows.column + rows.begin[i], rows.column + rows.begin[i + 1], i);
      const Node sum = times_x(rows, rows.begin[i], before - rows.column);
      Node::load(rows.right + i * kNode).plus(-1 / kLargestFixedPoint, sum).store(rows.x + i * kNode);
    }
  }

  void residual(const BlockRows& rows, std::int32_t first, std::int32_t last) const override {
    for (std::ptrdiff_t i = first; i < last; ++i) {
      const std::int32_t* after = std::lower_bound(rows.column + rows.begin[i], rows.column + rows.begin[i + 1], i);
      const Node sum = times_x(rows, after - rows.column, rows.begin[i + 1]);
      Node::zero().plus(-1 / kLargestFixedPoint, sum).store(rows.residual + i * kNode);
    }
  }

  void backward(const BlockRows& rows, std::int32_t first, std::int32_t last) const override {
    for (std::ptrdiff_t i = first; i < last; ++i) {
      const Node sum = times_x(rows, rows.begin[i], rows.begin[i + 1]);
      Node::load(rows.right + i * kNode).plus(-1 / kLargestFixedPoint, sum).store(rows.x + i * kNode);
    }
  }

  void restrict_cells(BatchSet& set, std::int32_t b, const SparseRows& rows, const float* values) const override {
    const int nodes = set.cells->nodes_per_cell, coarse = static_cast<int>(rows.begin.size()) - 1;
    static thread_local AlignedVector<float> scratch;
    scratch.resize(static_cast<std::size_t>(nodes + coarse) * d * kBatch);
    float *u = scratch.data(), *out = u + nodes * d * kBatch;
    CellLanes<d>::gather(set.ranks.data() + static_cast<std::size_t>(b) * nodes * kBatch, nodes, values, u);
    for (int a = 0; a < coarse; ++a)
      for (int lane = 0; lane < kBatch; lane += static_cast<int>(hn::Lanes(FloatTag()))) {
        Floats sum[d];
        unrolled<d>([&](auto i) { sum[i] = hn::Zero(FloatTag()); });
        for (std::int64_t e = rows.begin[a]; e < rows.begin[a + 1]; ++e)
          unrolled<d>([&](auto i) {
            sum[i] = hn::MulAdd(varimesh::HWY_NAMESPACE::load(u + (rows.column[e] * d + i) * kBatch + lane),
                                every(rows.factor[e]), sum[i]);
          });
        unrolled<d>([&](auto i) { hn::Store(sum[i], FloatTag(), out + (a * d + i) * kBatch + lane); });
      }
    CellLanes<d>::interleave(out, coarse, set.contributions.data() + contribution_index(b * kBatch, 0, coarse, d));
  }

  void add_up(const std::array<Contributions, kShapes>& contributions, const std::int64_t* begin,
              const Incidence* cells, const float* blocks, float* to, std::int32_t first,
              std::int32_t last) const override {
    for (std::ptrdiff_t i = first; i < last; ++i) {
      alignas(16) float at[4];
      sum_of_contributions<d>(cells + begin[i], cells + begin[i + 1], contributions).store(at);
      Sum sum;
      sum.add(blocks + i * d * d, at);
      sum.total().store(to + i * kNode);
    }
  }

  double precondition(const Problem& problem, const CoarseSpace& space, const float* coarse, const float* blocks,
                      const float* r, float* z, std::int32_t first, std::int32_t last) const override {
    double along = 0;
    for (std::ptrdiff_t i = first; i < last; ++i) {
      alignas(16) float at[4] = {};
      if (space.count > 0) interpolated(problem.incidences[problem.offsets[i]], space, coarse).store(at);
      const float *B = blocks + i * triangle_size(d), *from = r + i * d;
      for (int k = 0, entry = 0; k < d; ++k)
        for (int l = 0; l <= k; ++l, ++entry) {
          at[k] += B[entry] * from[l];
          if (l < k) at[l] += B[entry] * from[k];
        }
      for (int k = 0; k < d; ++k) {
        z[i * d + k] = at[k];
        along += static_cast<double>(at[k]) * from[k];
      }
    }
    return along;
  }

 private:
  /// The value at a node of a cell, interpolated from the cell's coarse nodes.
  static HWY_INLINE Node interpolated(const Incidence& at, const CoarseSpace& space, const float* coarse) {
    const CoarseSpace::Set& set = space.sets[at.set];
    const std::int32_t* nodes = set.nodes.data() + static_cast<std::ptrdiff_t>(at.cell) * set.nodes_per_cell;
    Node sum = Node::zero();
    for (std::int64_t e = set.values.begin[at.local]; e < set.values.begin[at.local + 1]; ++e) {
      const std::ptrdiff_t node = nodes[set.values.column[e]];
      if (node >= 0) sum = sum.plus(set.values.factor[e], coarse + node * kNode);
    }
    return sum;
  }
};

CoarseKernels* new_coarse_kernels_2d() { return new VectorCoarseKernels<2>(); }
CoarseKernels* new_coarse_kernels_3d() { return new VectorCoarseKernels<3>(); }

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace varimesh {

HWY_EXPORT(new_coarse_kernels_2d);
HWY_EXPORT(new_coarse_kernels_3d);

std::unique_ptr<CoarseKernels> make_coarse_kernels(int dimension) {
  return std::unique_ptr<CoarseKernels>(dimension == 2 ? HWY_DYNAMIC_DISPATCH(new_coarse_kernels_2d)()
                                                       : HWY_DYNAMIC_DISPATCH(new_coarse_kernels_3d)());
}

}  // namespace varimesh
#endif
