// Scaled coefficients, one at a time: of the map of a cell, of its derivatives, of their cross product and of J
// (bernstein.h). Internal to the library; for vectors of cells on the processor and for one cell per thread on a
// device. Each product is fused as it is written, so both have the same bits where the processor fuses too.
//
// Arrays of coefficients are [coefficient][component][lane], with `lanes` lanes. Pointers to them point to the first
// lane of a vector.
#if defined(VARIMESH_VALIDITY_COEFFICIENTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_VALIDITY_COEFFICIENTS_INL_H
#undef VARIMESH_VALIDITY_COEFFICIENTS_INL_H
#else
#define VARIMESH_VALIDITY_COEFFICIENTS_INL_H
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, 32>;  // kMostLanes
using V = hn::Vec<D>;

/// The entries `begin` to `end` − 1 of a table: of a row of the conversion matrix, or of a convolution.
struct Entries {
  std::uint32_t begin, end;
};

/// A scaled coefficient of χ: a row of the sparse matrix times the coordinates.
template <int kDim>
HWY_INLINE void ConvertRow(const double* value, const std::uint16_t* column, Entries row, const double* nodes,
                           std::size_t lanes, double* to) {
  const D d;
  V x = hn::Zero(d), y = x, z = x;
  for (std::uint32_t e = row.begin; e < row.end; ++e) {
    const V entry = hn::Set(d, value[e]);
    const double* at = nodes + column[e] * kDim * lanes;
    x = hn::MulAdd(entry, hn::Load(d, at), x);
    y = hn::MulAdd(entry, hn::Load(d, at + lanes), y);
    if constexpr (kDim == 3) z = hn::MulAdd(entry, hn::Load(d, at + 2 * lanes), z);
  }
  hn::Store(x, d, to);
  hn::Store(y, d, to + lanes);
  if constexpr (kDim == 3) hn::Store(z, d, to + 2 * lanes);
}

/// A component of a scaled coefficient of a derivative, from two of χ.
HWY_INLINE V DifferenceOf(double plus_weight, const double* plus, double minus_weight, const double* minus) {
  const D d;
  return hn::NegMulAdd(hn::Set(d, minus_weight), hn::Load(d, minus), hn::Set(d, plus_weight) * hn::Load(d, plus));
}

/// A scaled coefficient of a × b.
/// @param pairs  those of Convolution, two numbers each
HWY_INLINE void CrossRow(const std::uint16_t* pairs, Entries row, const double* a, const double* b, std::size_t lanes,
                         double* to) {
  const D d;
  V x = hn::Zero(d), y = x, z = x;
  for (std::uint32_t e = row.begin; e < row.end; ++e) {
    const double* p = a + pairs[2 * e] * 3 * lanes;
    const double* q = b + pairs[2 * e + 1] * 3 * lanes;
    const V px = hn::Load(d, p), py = hn::Load(d, p + lanes), pz = hn::Load(d, p + 2 * lanes);
    const V qx = hn::Load(d, q), qy = hn::Load(d, q + lanes), qz = hn::Load(d, q + 2 * lanes);
    x = hn::NegMulAdd(pz, qy, hn::MulAdd(py, qz, x));
    y = hn::NegMulAdd(px, qz, hn::MulAdd(pz, qx, y));
    z = hn::NegMulAdd(py, qx, hn::MulAdd(px, qy, z));
  }
  hn::Store(x, d, to);
  hn::Store(y, d, to + lanes);
  hn::Store(z, d, to + 2 * lanes);
}

/// A scaled coefficient of J: of a · b in space, where b is the cross product, and of det(a, b) in the plane.
template <int kDim>
HWY_INLINE V Coefficient(const std::uint16_t* pairs, Entries row, const double* a, const double* b, std::size_t lanes) {
  const D d;
  V sum = hn::Zero(d), second = sum;  // two chains: in a single one each sum waits for the last
  for (std::uint32_t e = row.begin; e < row.end; ++e) {
    const double* p = a + pairs[2 * e] * kDim * lanes;
    const double* q = b + pairs[2 * e + 1] * kDim * lanes;
    if constexpr (kDim == 2) {
      sum = hn::MulAdd(hn::Load(d, p), hn::Load(d, q + lanes), sum);
      second = hn::NegMulAdd(hn::Load(d, p + lanes), hn::Load(d, q), second);
    } else {
      const bool is_odd = (e & 1) != 0;
      V chain = is_odd ? second : sum;
      chain = hn::MulAdd(hn::Load(d, p), hn::Load(d, q), chain);
      chain = hn::MulAdd(hn::Load(d, p + lanes), hn::Load(d, q + lanes), chain);
      chain = hn::MulAdd(hn::Load(d, p + 2 * lanes), hn::Load(d, q + 2 * lanes), chain);
      if (is_odd)
        second = chain;
      else
        sum = chain;
    }
  }
  return sum + second;
}

}  // namespace varimesh::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
