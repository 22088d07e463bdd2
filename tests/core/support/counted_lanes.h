// A vector instruction set of one lane that counts its floating-point operations, in the place of Highway's. A "-inl"
// header of the core that is included after this one is compiled for it. Include this header first, and no other that
// needs Highway's own vectors after it.
#pragma once

#include <hwy/highway.h>
// What "-inl" headers include of Highway, so that its include guards keep it out of the namespace below.
#include <hwy/contrib/math/math-inl.h>

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#undef HWY_NAMESPACE
#define HWY_NAMESPACE N_COUNTED
#undef HWY_TARGET
#define HWY_TARGET HWY_SCALAR

namespace hwy::N_COUNTED {

/// Operations so far: one for an addition, subtraction, multiplication, division or root, two for a fused
/// multiplication and addition.
inline std::int64_t operations = 0;

template <class T>
struct Lane {
  T value;
};

template <class T>
Lane<T> counted(T value, int count = 1) {
  if constexpr (std::is_floating_point_v<T>) operations += count;
  return {value};
}

template <class T>
Lane<T> operator+(Lane<T> a, Lane<T> b) {
  return counted(static_cast<T>(a.value + b.value));
}
template <class T>
Lane<T> operator-(Lane<T> a, Lane<T> b) {
  return counted(static_cast<T>(a.value - b.value));
}
template <class T>
Lane<T> operator*(Lane<T> a, Lane<T> b) {
  return counted(static_cast<T>(a.value * b.value));
}
template <class T>
Lane<T> operator/(Lane<T> a, Lane<T> b) {
  return counted(static_cast<T>(a.value / b.value));
}
template <class T>
Lane<T> operator&(Lane<T> a, Lane<T> b) {
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
using RebindToSigned = CappedTag<std::int64_t, 1>;  // of doubles

template <class D>
constexpr std::size_t Lanes(D) {
  return 1;
}
template <class D>
constexpr std::size_t MaxLanes(D) {
  return 1;
}
template <class D>
Vec<D> Set(D, TFromD<D> value) {
  return {value};
}
template <class D>
Vec<D> Zero(D) {
  return {0};
}
template <class D>
Vec<D> Load(D, const TFromD<D>* from) {
  return {*from};
}
template <class D>
Vec<D> LoadU(D, const TFromD<D>* from) {
  return {*from};
}
template <class D>
void Store(Vec<D> v, D, TFromD<D>* to) {
  *to = v.value;
}
template <class D>
void StoreU(Vec<D> v, D, TFromD<D>* to) {
  *to = v.value;
}
template <class D>
void StoreInterleaved2(Vec<D> a, Vec<D> b, D, TFromD<D>* to) {
  to[0] = a.value;
  to[1] = b.value;
}
template <class D>
void StoreInterleaved3(Vec<D> a, Vec<D> b, Vec<D> c, D, TFromD<D>* to) {
  to[0] = a.value;
  to[1] = b.value;
  to[2] = c.value;
}
template <class T>
T GetLane(Lane<T> v) {
  return v.value;
}
template <class D>
Vec<D> SumOfLanes(D, Vec<D> v) {
  return v;
}
template <class D>
Vec<D> MinOfLanes(D, Vec<D> v) {
  return v;
}
template <class D>
Vec<D> MaxOfLanes(D, Vec<D> v) {
  return v;
}

template <class T>
Lane<T> MulAdd(Lane<T> a, Lane<T> b, Lane<T> c) {
  return counted(static_cast<T>(a.value * b.value + c.value), 2);
}
template <class T>
Lane<T> MulSub(Lane<T> a, Lane<T> b, Lane<T> c) {
  return counted(static_cast<T>(a.value * b.value - c.value), 2);
}
template <class T>
Lane<T> NegMulAdd(Lane<T> a, Lane<T> b, Lane<T> c) {
  return counted(static_cast<T>(c.value - a.value * b.value), 2);
}
template <class T>
Lane<T> Sqrt(Lane<T> v) {
  return counted(std::sqrt(v.value));
}
template <class T>
Lane<T> Neg(Lane<T> v) {
  return {-v.value};
}
template <class T>
Lane<T> Min(Lane<T> a, Lane<T> b) {
  return {b.value < a.value ? b.value : a.value};
}
template <class T>
Lane<T> Max(Lane<T> a, Lane<T> b) {
  return {a.value < b.value ? b.value : a.value};
}
template <class T>
bool Lt(Lane<T> a, Lane<T> b) {
  return a.value < b.value;
}
template <class T>
bool Gt(Lane<T> a, Lane<T> b) {
  return a.value > b.value;
}
inline bool And(bool a, bool b) { return a && b; }
template <class D>
bool AllTrue(D, bool mask) {
  return mask;
}
template <class T>
Lane<T> IfThenElse(bool mask, Lane<T> then, Lane<T> otherwise) {
  return mask ? then : otherwise;
}
template <class D, class T>
Vec<D> BitCast(D, Lane<T> v) {
  return {std::bit_cast<TFromD<D>>(v.value)};
}
template <class D, class T>
Vec<D> ConvertTo(D, Lane<T> v) {
  return {static_cast<TFromD<D>>(v.value)};
}
template <class D, class T>
Vec<D> PromoteTo(D, Lane<T> v) {
  return {static_cast<TFromD<D>>(v.value)};
}
template <class D>
Vec<D> Log(D, Vec<D> v) {
  return counted(std::log(v.value));
}

}  // namespace hwy::N_COUNTED
