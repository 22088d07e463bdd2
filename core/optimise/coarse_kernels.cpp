// The preconditioner's loops, compiled once for each instruction set. A lane is a component: vectors longer than a
// node's would have to gather.
#include "core/optimise/coarse_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/optimise/coarse_kernels.cpp"
#include <hwy/foreach_target.h>
// Highway wants its targets' includes after foreach_target.h.
#include <hwy/highway.h>

#include "core/optimise/node_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <int d>
class VectorCoarseKernels final : public CoarseKernels {
  static constexpr int kNode = padded(d), kBlock = block_size(d);
  using Node = NodeVector<d>;

  /// A sum in d columns, so that each addition need not wait for the one before.
  struct Sum {
    Node column[3];
    HWY_INLINE Sum() : column{Node::zero(), Node::zero(), Node::zero()} {}
    /// += K x
    HWY_INLINE void add(const float* K, const float* x) {
      column[0] = column[0].plus(x[0], K);
      column[1] = column[1].plus(x[1], K + kNode);
      if constexpr (d == 3) column[2] = column[2].plus(x[2], K + 2 * kNode);
    }
    HWY_INLINE Node total() const { return column[0] + (column[1] + column[2]); }
  };

  static HWY_INLINE Node product(const float* K, const Node& x) {
    alignas(16) float at[4];
    x.store(at);
    Sum sum;
    sum.add(K, at);
    return sum.total();
  }

  /// Row i; `stride` floats from one vector of `from` to the next.
  static HWY_INLINE Node factors(const FactorRows& rows, const float* from, int stride, std::int32_t i) {
    Node even = Node::zero(), odd = even;
    std::int32_t e = rows.begin[i];
    const std::int32_t end = rows.begin[i + 1];
    for (; e + 1 < end; e += 2) {
      even = even.plus(rows.factor[e], from + static_cast<std::ptrdiff_t>(rows.column[e]) * stride);
      odd = odd.plus(rows.factor[e + 1], from + static_cast<std::ptrdiff_t>(rows.column[e + 1]) * stride);
    }
    if (e < end) even = even.plus(rows.factor[e], from + static_cast<std::ptrdiff_t>(rows.column[e]) * stride);
    return even + odd;
  }

 public:
  void forward(const BlockRows& rows, std::int32_t first, std::int32_t last) const override {
    for (std::ptrdiff_t i = first; i < last; ++i) {
      Sum sum;
      for (std::int64_t e = rows.begin[i]; rows.column[e] < i; ++e)
        sum.add(rows.entry + e * kBlock, rows.x + static_cast<std::ptrdiff_t>(rows.column[e]) * kNode);
      const Node left = Node::load(rows.right + i * kNode) - sum.total();
      product(rows.inverse_diagonal + i * kBlock, left).store(rows.x + i * kNode);
    }
  }

  void residual(const BlockRows& rows, std::int32_t first, std::int32_t last) const override {
    for (std::ptrdiff_t i = first; i < last; ++i) {
      Sum sum;
      for (std::int64_t e = rows.begin[i + 1]; e-- > rows.begin[i] && rows.column[e] > i;)
        sum.add(rows.entry + e * kBlock, rows.x + static_cast<std::ptrdiff_t>(rows.column[e]) * kNode);
      (Node::zero() - sum.total()).store(rows.residual + i * kNode);
    }
  }

  void backward(const BlockRows& rows, std::int32_t first, std::int32_t last) const override {
    for (std::ptrdiff_t i = first; i < last; ++i) {
      Sum sum;
      for (std::int64_t e = rows.begin[i]; e < rows.begin[i + 1]; ++e)
        sum.add(rows.entry + e * kBlock, rows.x + static_cast<std::ptrdiff_t>(rows.column[e]) * kNode);
      const Node left = Node::load(rows.right + i * kNode) - sum.total();
      float* x = rows.x + i * kNode;
      (Node::load(x) + product(rows.inverse_diagonal + i * kBlock, left)).store(x);
    }
  }

  void restrict_to(const FactorRows& rows, const float* from, float* to, std::int32_t first,
                   std::int32_t last) const override {
    for (std::int32_t i = first; i < last; ++i) {
      float* at = to + static_cast<std::ptrdiff_t>(i) * kNode;
      factors(rows, from, d, i).store(at);
      if constexpr (d == 3) at[3] = 0;  // it came from the next node
    }
  }

  double precondition(const FactorRows& rows, const float* from, const float* blocks, const float* r, float* z,
                      std::int32_t first, std::int32_t last) const override {
    double along = 0;
    for (std::ptrdiff_t i = first; i < last; ++i) {
      Sum sum;
      sum.add(blocks + i * kBlock, r + i * d);
      Node out = sum.total();
      if (rows.begin != nullptr) out = out + factors(rows, from, kNode, static_cast<std::int32_t>(i));
      alignas(16) float at[4];
      out.store(at);
      for (int k = 0; k < d; ++k) {
        z[i * d + k] = at[k];
        along += static_cast<double>(at[k]) * r[i * d + k];
      }
    }
    return along;
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
