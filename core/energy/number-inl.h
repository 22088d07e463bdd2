// The few functions that the energies need of a number, for doubles and for vectors of them, so that each formula is
// written once and serves the plain path, the tests (in quadruple precision) and every vector width.
//
// A "-inl" header is compiled once for each vector instruction set (see Google Highway's foreach_target.h), hence the
// guard that toggles.
#if defined(VARIMESH_ENERGY_NUMBER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_ENERGY_NUMBER_INL_H
#undef VARIMESH_ENERGY_NUMBER_INL_H
#else
#define VARIMESH_ENERGY_NUMBER_INL_H
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cmath>
#include <type_traits>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Calls body(0), …, body(n − 1) with constants, so that arrays indexed by them live in registers: GCC does not take
/// arrays apart that loops run over, however short. Under a sanitizer, which checks every one of these calls, a kernel
/// would take minutes to compile: there it is a loop.
template <int n, class Body>
HWY_INLINE void unrolled(const Body& body) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  for (int i = 0; i < n; ++i) body(i);
#else
  [&]<int... i>(std::integer_sequence<int, i...>) __attribute__((always_inline)) {
    (body(std::integral_constant<int, i>()), ...);
  }
  (std::make_integer_sequence<int, n>());
#endif
}

/// The same for 0, …, i − 1, with i a constant of unrolled()'s (or its loop's variable).
template <class Index, class Body>
HWY_INLINE void unrolled_below(Index i, const Body& body) {
  if constexpr (std::is_same_v<Index, int>)
    for (int j = 0; j < i; ++j) body(j);
  else
    unrolled<Index::value>(body);
}
/// For 0, …, i.
template <class Index, class Body>
HWY_INLINE void unrolled_through(Index i, const Body& body) {
  unrolled_below(i, body);
  body(i);
}

// A plain double.
HWY_INLINE double logarithm(double x) { return std::log(x); }
HWY_INLINE double inverse_cube_root(double x) { return 1 / std::cbrt(x); }
HWY_INLINE double square_root(double x) { return std::sqrt(x); }
HWY_INLINE double where_negative(double x, double then, double otherwise) { return x < 0 ? then : otherwise; }
HWY_INLINE double negative(double x) { return -x; }
HWY_INLINE double fused(double a, double b, double c) { return a * b + c; }

// A vector of doubles or floats. The logarithm of a number that is not positive and finite is a finite number here,
// not a NaN (Highway 1.0.3): callers test before they take it.
template <class V, class D = hn::DFromV<V>>
HWY_INLINE V logarithm(V x) {
  return hn::Log(D(), x);
}
/// x^(−1/3) of a positive normal double to two units in the last place, in a third of the time that a logarithm and an
/// exponential take. The bits of a double are nearly linear in its logarithm: a third of them, taken from a constant,
/// is a root with y = 1 − x r³ below 0.11, and each step of the series r (1 − y)^(−1/3) raises y to its fifth power.
template <class V, class D = hn::DFromV<V>>
HWY_INLINE V inverse_cube_root(V x) {
  static_assert(std::is_same_v<hn::TFromD<D>, double>);
  const D d;
  const hn::RebindToSigned<D> bits;
  // 4/3 of the exponent's bias, less 0.051, which makes the largest y least; found by trying.
  const V constant = hn::Set(d, 4.0 / 3 * (1023 - 0.051) * 0x1p52);
  const V root = hn::MulAdd(hn::ConvertTo(d, hn::BitCast(bits, x)), hn::Set(d, -1.0 / 3), constant);
  V r = hn::BitCast(d, hn::ConvertTo(bits, root));
  for (int step = 0; step < 2; ++step) {
    const V y = hn::NegMulAdd(x * r, r * r, hn::Set(d, 1.0));
    V series = hn::MulAdd(y, hn::Set(d, 35.0 / 243), hn::Set(d, 14.0 / 81));
    series = hn::MulAdd(y, series, hn::Set(d, 2.0 / 9));
    series = hn::MulAdd(y, series, hn::Set(d, 1.0 / 3));
    r = hn::MulAdd(r * y, series, r);
  }
  return r;
}
template <class V, class D = hn::DFromV<V>>
HWY_INLINE V square_root(V x) {
  return hn::Sqrt(x);
}
template <class V, class D = hn::DFromV<V>>
HWY_INLINE V where_negative(V x, V then, V otherwise) {
  return hn::IfThenElse(hn::Lt(x, hn::Zero(D())), then, otherwise);
}
template <class V, class D = hn::DFromV<V>>
HWY_INLINE V negative(V x) {
  return hn::Neg(x);
}
template <class V, class D = hn::DFromV<V>>
HWY_INLINE V fused(V a, V b, V c) {
  return hn::MulAdd(a, b, c);
}

/// The number c as a T.
template <class T>
struct Constant {
  static HWY_INLINE T of(double c) {
    using D = hn::DFromV<T>;
    return hn::Set(D(), static_cast<hn::TFromD<D>>(c));
  }
};
template <>
struct Constant<double> {
  static HWY_INLINE double of(double c) { return c; }
};

template <class T>
HWY_INLINE T number(double c) {
  return Constant<T>::of(c);
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
