// The vector of one node, one component per lane.
#if defined(VARIMESH_HESSIAN_NODE_VECTOR_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_HESSIAN_NODE_VECTOR_INL_H
#undef VARIMESH_HESSIAN_NODE_VECTOR_INL_H
#else
#define VARIMESH_HESSIAN_NODE_VECTOR_INL_H
#endif

#include <hwy/highway.h>

#include <array>

#include "core/base/aligned.h"
#include "core/kernels/hessian/batches.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// padded(d) numbers. Loads and stores need no alignment.
template <int d>
struct NodeVector {
  using Tag = hn::CappedTag<float, padded(d)>;
  /// Registers per vector: 1, or padded(d) if the machine's vectors have only one lane.
  static constexpr int kRegisters = padded(d) / static_cast<int>(hn::MaxLanes(Tag()));
  static_assert(kRegisters == 1 || kRegisters == padded(d));

  hn::Vec<Tag> lanes[kRegisters];

  static HWY_INLINE NodeVector zero() {
    NodeVector out;
    for (auto& lanes : out.lanes) lanes = hn::Zero(Tag());
    return out;
  }
  static HWY_INLINE NodeVector load(const float* from) {
    NodeVector out;
    for (int r = 0; r < kRegisters; ++r) out.lanes[r] = hn::LoadU(Tag(), from + r);
    return out;
  }
  HWY_INLINE void store(float* to) const {
    for (int r = 0; r < kRegisters; ++r) hn::StoreU(lanes[r], Tag(), to + r);
  }
  static HWY_INLINE NodeVector load(const std::int16_t* from) {
    NodeVector out;
    for (int r = 0; r < kRegisters; ++r)
      out.lanes[r] = hn::ConvertTo(
          Tag(), hn::PromoteTo(hn::Rebind<std::int32_t, Tag>(), hn::LoadU(hn::Rebind<std::int16_t, Tag>(), from + r)));
    return out;
  }
  /// this + s · other
  HWY_INLINE NodeVector plus(float s, const NodeVector& other) const {
    NodeVector out;
    for (int r = 0; r < kRegisters; ++r) out.lanes[r] = hn::MulAdd(other.lanes[r], hn::Set(Tag(), s), lanes[r]);
    return out;
  }
  /// this + s · (the vector at `from`)
  HWY_INLINE NodeVector plus(float s, const float* from) const { return plus(s, load(from)); }
  HWY_INLINE NodeVector operator+(const NodeVector& other) const {
    NodeVector out;
    for (int r = 0; r < kRegisters; ++r) out.lanes[r] = lanes[r] + other.lanes[r];
    return out;
  }
  HWY_INLINE NodeVector operator-(const NodeVector& other) const {
    NodeVector out;
    for (int r = 0; r < kRegisters; ++r) out.lanes[r] = lanes[r] - other.lanes[r];
    return out;
  }
};

/// The sum of the contributions of a node's cells (width d), in the order of its incidences. In 3-D this reads one
/// number past each contribution; BatchSet::contributions has room for 2 d per node.
template <int d>
HWY_INLINE NodeVector<d> sum_of_contributions(const Incidence* first, const Incidence* last,
                                              const std::array<Contributions, kShapes>& contributions) {
  NodeVector<d> sum = NodeVector<d>::zero();
  for (; first < last; ++first) {
    const Contributions& set = contributions[first->set];
    sum = sum + NodeVector<d>::load(set.data + contribution_index(first->cell, first->local, set.nodes, d));
  }
  return sum;
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
