// A node's vector, a lane a component.
#if defined(VARIMESH_OPTIMISE_NODE_VECTOR_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_OPTIMISE_NODE_VECTOR_INL_H
#undef VARIMESH_OPTIMISE_NODE_VECTOR_INL_H
#else
#define VARIMESH_OPTIMISE_NODE_VECTOR_INL_H
#endif

#include <hwy/highway.h>

#include <array>

#include "core/base/aligned.h"
#include "core/hessian/batches.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// padded(d) numbers; what is read and written need not be aligned.
template <int d>
struct NodeVector {
  using Tag = hn::CappedTag<float, padded(d)>;
  static constexpr int kParts = padded(d) / static_cast<int>(hn::MaxLanes(Tag()));  // 1, but where vectors are numbers
  static_assert(kParts == 1 || kParts == padded(d));

  hn::Vec<Tag> part[kParts];

  static HWY_INLINE NodeVector zero() {
    NodeVector out;
    for (auto& part : out.part) part = hn::Zero(Tag());
    return out;
  }
  static HWY_INLINE NodeVector load(const float* from) {
    NodeVector out;
    for (int p = 0; p < kParts; ++p) out.part[p] = hn::LoadU(Tag(), from + p);
    return out;
  }
  HWY_INLINE void store(float* to) const {
    for (int p = 0; p < kParts; ++p) hn::StoreU(part[p], Tag(), to + p);
  }
  static HWY_INLINE NodeVector load(const std::int16_t* from) {
    NodeVector out;
    for (int p = 0; p < kParts; ++p)
      out.part[p] = hn::ConvertTo(
          Tag(), hn::PromoteTo(hn::Rebind<std::int32_t, Tag>(), hn::LoadU(hn::Rebind<std::int16_t, Tag>(), from + p)));
    return out;
  }
  /// this + s · other
  HWY_INLINE NodeVector plus(float s, const NodeVector& other) const {
    NodeVector out;
    for (int p = 0; p < kParts; ++p) out.part[p] = hn::MulAdd(other.part[p], hn::Set(Tag(), s), part[p]);
    return out;
  }
  /// this + s · (what is at `from`)
  HWY_INLINE NodeVector plus(float s, const float* from) const { return plus(s, load(from)); }
  HWY_INLINE NodeVector operator+(const NodeVector& other) const {
    NodeVector out;
    for (int p = 0; p < kParts; ++p) out.part[p] = part[p] + other.part[p];
    return out;
  }
  HWY_INLINE NodeVector operator-(const NodeVector& other) const {
    NodeVector out;
    for (int p = 0; p < kParts; ++p) out.part[p] = part[p] - other.part[p];
    return out;
  }
};

/// The sum of a node's cells' parts, d wide, in their order. In 3-D a number past a part's last is read: in
/// BatchSet::parts there is room for more than d.
template <int d>
HWY_INLINE NodeVector<d> sum_of_parts(const Incidence* first, const Incidence* last,
                                      const std::array<PartsOf, kShapes>& parts) {
  NodeVector<d> sum = NodeVector<d>::zero();
  for (; first < last; ++first) {
    const PartsOf& of = parts[first->set];
    sum = sum + NodeVector<d>::load(of.data + part_index(first->cell, first->local, of.nodes, d));
  }
  return sum;
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
