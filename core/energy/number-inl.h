// The functions of numbers that the energies need, for doubles and for vectors of doubles. So each formula is written
// once, for the plain code, for the tests in quadruple precision and for every vector width.
//
// A "-inl" header is compiled once for each vector instruction set, as Google Highway's foreach_target.h explains. Its
// include guard is therefore toggled.
#if defined(VARIMESH_ENERGY_NUMBER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_ENERGY_NUMBER_INL_H
#undef VARIMESH_ENERGY_NUMBER_INL_H
#else
#define VARIMESH_ENERGY_NUMBER_INL_H
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cmath>
#include <cstdint>
#include <type_traits>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Calls body(0), …, body(n − 1) with compile-time constants, so that arrays which these index can stay in registers.
/// GCC keeps an array in memory if a loop runs over it, however short. With a sanitizer this is a loop: the sanitizer
/// checks each of these calls, and a kernel would take minutes to compile.
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

/// The same for 0, …, i − 1, where i is an argument of the body of unrolled().
template <class Index, class Body>
HWY_INLINE void unrolled_below(Index i, const Body& body) {
  if constexpr (std::is_same_v<Index, int>)
    for (int j = 0; j < i; ++j) body(j);
  else
    unrolled<Index::value>(body);
}
/// The same for 0, …, i.
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

// A vector of doubles or floats. The logarithm of a number that is not positive, normal and finite is an arbitrary
// finite number, not NaN. Callers check the number first.

/// ln(1 + f)/f² − 1/f for f from √½ − 1 to √2 − 1, with an error of at most 7·10⁻¹⁷ ln(1 + f). This is the polynomial
/// −½ + f R(f) with the smallest maximal error (Remez' algorithm), with rounded coefficients.
template <class V, class D = hn::DFromV<V>>
HWY_INLINE V logarithm_series(V f) {
  constexpr int kDegree = 18;
  constexpr double kSeries[kDegree + 1] = {
      -0.5,
      0.3333333333332809,
      -0.249999999999949,
      0.20000000001740467,
      -0.16666666669056104,
      0.14285714088894055,
      -0.12499999637819376,
      0.11111121791597144,
      -0.10000025072261277,
      0.09090595174226296,
      -0.08332414614106841,
      0.0769739685942078,
      -0.07161756386845806,
      0.06626042338529861,
      -0.06033667236138117,
      0.05941484607587631,
      -0.06789075748327396,
      0.06418263534392885,
      -0.02911776588847392,
  };
  const D d;
  const V f2 = f * f, f4 = f2 * f2;
  V part[4];  // four independent Horner schemes in f⁴, because each step of one waits for the last
  unrolled<4>([&](auto j) {
    const int last = kDegree - (kDegree - j) % 4;
    part[j] = hn::Set(d, kSeries[last]);
    unrolled<kDegree / 4>([&](auto k) {
      const int next = last - 4 * (k + 1);
      if (next >= 0) part[j] = hn::MulAdd(part[j], f4, hn::Set(d, kSeries[next]));
    });
  });
  return hn::MulAdd(f2, hn::MulAdd(f, part[3], part[2]), hn::MulAdd(f, part[1], part[0]));
}

/// The logarithm of a positive normal double, to two units in the last place. With x = 2^e (1 + f) and 1 + f from √½ to
/// √2 it is e ln 2 + ln(1 + f), which a polynomial computes. The usual series in f/(2 + f) has fewer terms, but its
/// division takes longer than the terms that it saves.
template <class V, class D = hn::DFromV<V>>
HWY_INLINE V logarithm(V x) {
  const D d;
  if constexpr (!std::is_same_v<hn::TFromD<D>, double>) {
    return hn::Log(d, x);
  } else {
    const hn::RebindToSigned<D> bits;
    const auto whole = hn::BitCast(bits, x);
    const auto root_half = hn::Set(bits, 0x3FE6A09E667F3BCD);
    const auto exponent = (whole - root_half) & hn::Set(bits, ~((std::int64_t{1} << 52) - 1));  // 2⁵² e
    const V f = hn::BitCast(d, whole - exponent) - hn::Set(d, 1.0);
    const V of_fraction = hn::MulAdd(f * f, logarithm_series(f), f);
    return hn::MulAdd(hn::ConvertTo(d, exponent), hn::Set(d, 0.6931471805599453 * 0x1p-52), of_fraction);
  }
}
/// x^(−1/3) of a positive normal double, to two units in the last place, in a third of the time of a logarithm and an
/// exponential. The bits of a double are nearly linear in its logarithm. So a constant minus a third of the bits gives
/// an approximation r for which y = 1 − x r³ is below 0.11. Each step of the series r (1 − y)^(−1/3) raises y to its
/// fifth power.
template <class V, class D = hn::DFromV<V>>
HWY_INLINE V inverse_cube_root(V x) {
  static_assert(std::is_same_v<hn::TFromD<D>, double>);
  const D d;
  const hn::RebindToSigned<D> bits;
  // 4/3 of the exponent's bias minus 0.051. The 0.051 minimises the largest y and was found by experiment.
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
