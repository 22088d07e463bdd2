// What the formulas of core/energy and core/kernels need of Google Highway, as a vector instruction set of one lane, in
// plain C++. With this folder before Highway's own in the list of includes, the "-inl" headers of the core compile for
// a device and, from the same source, for the processor in a device's place. So each formula stands once.
//
// Everything rounds as IEEE 754 says and nothing is contracted: a fused multiplication and addition is written as one.
// So a device and the processor compute the same bits.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#define HWY_NAMESPACE N_ONE_LANE
#define HWY_BEFORE_NAMESPACE() static_assert(true)
#define HWY_AFTER_NAMESPACE() static_assert(true)
#define HWY_INLINE inline __attribute__((always_inline))
#define HWY_FLATTEN __attribute__((flatten))
#define HWY_NOINLINE __attribute__((noinline))

namespace hwy::N_ONE_LANE {

template <class T>
struct Lane {
  T value;
};

template <class T>
HWY_INLINE Lane<T> operator+(Lane<T> a, Lane<T> b) {
  return {static_cast<T>(a.value + b.value)};
}
template <class T>
HWY_INLINE Lane<T> operator-(Lane<T> a, Lane<T> b) {
  return {static_cast<T>(a.value - b.value)};
}
template <class T>
HWY_INLINE Lane<T> operator*(Lane<T> a, Lane<T> b) {
  return {static_cast<T>(a.value * b.value)};
}
template <class T>
HWY_INLINE Lane<T> operator/(Lane<T> a, Lane<T> b) {
  return {static_cast<T>(a.value / b.value)};
}
template <class T>
HWY_INLINE Lane<T> operator&(Lane<T> a, Lane<T> b) {
  return {static_cast<T>(a.value & b.value)};
}

template <class T, std::size_t>
struct CappedTag {
  using Number = T;
};
template <class D>
using TFromD = typename D::Number;
template <class D>
using Vec = Lane<TFromD<D>>;
template <class V>
using DFromV = CappedTag<decltype(V::value), 1>;
template <class T, class D>
using Rebind = CappedTag<T, 1>;
template <class D>
using RebindToSigned =
    CappedTag<std::conditional_t<sizeof(TFromD<D>) == sizeof(std::int64_t), std::int64_t, std::int32_t>, 1>;

template <class D>
constexpr std::size_t Lanes(D) {
  return 1;
}
template <class D>
HWY_INLINE Vec<D> Set(D, TFromD<D> value) {
  return {value};
}
template <class D>
HWY_INLINE Vec<D> Zero(D) {
  return {0};
}
template <class D>
HWY_INLINE Vec<D> Load(D, const TFromD<D>* from) {
  return {*from};
}
template <class D>
HWY_INLINE void Store(Vec<D> v, D, TFromD<D>* to) {
  *to = v.value;
}

HWY_INLINE double fused(double a, double b, double c) { return __builtin_fma(a, b, c); }
HWY_INLINE float fused(float a, float b, float c) { return __builtin_fmaf(a, b, c); }
template <class T>
HWY_INLINE Lane<T> MulAdd(Lane<T> a, Lane<T> b, Lane<T> c) {
  return {fused(a.value, b.value, c.value)};
}
template <class T>
HWY_INLINE Lane<T> MulSub(Lane<T> a, Lane<T> b, Lane<T> c) {
  return {fused(a.value, b.value, -c.value)};
}
template <class T>
HWY_INLINE Lane<T> NegMulAdd(Lane<T> a, Lane<T> b, Lane<T> c) {
  return {fused(-a.value, b.value, c.value)};
}
HWY_INLINE Lane<double> Sqrt(Lane<double> v) { return {__builtin_sqrt(v.value)}; }
template <class T>
HWY_INLINE Lane<T> Neg(Lane<T> v) {
  return {-v.value};
}
template <class T>
HWY_INLINE bool Lt(Lane<T> a, Lane<T> b) {
  return a.value < b.value;
}
template <class T>
HWY_INLINE Lane<T> IfThenElse(bool mask, Lane<T> then, Lane<T> otherwise) {
  return mask ? then : otherwise;
}
template <class D, class T>
HWY_INLINE Vec<D> BitCast(D, Lane<T> v) {
  return {std::bit_cast<TFromD<D>>(v.value)};
}
template <class D, class T>
HWY_INLINE Vec<D> ConvertTo(D, Lane<T> v) {
  return {static_cast<TFromD<D>>(v.value)};
}
template <class D, class T>
HWY_INLINE Vec<D> PromoteTo(D, Lane<T> v) {
  return {static_cast<TFromD<D>>(v.value)};
}
/// Of floats. No kernel of a device takes it.
template <class D>
Vec<D> Log(D, Vec<D> v);

}  // namespace hwy::N_ONE_LANE
