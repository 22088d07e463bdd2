// An energy that only the tests have, written as docs/extending.md describes: W = (|F|² − d)/2 + 1/J − 1
#if defined(VARIMESH_TESTS_ADDED_ENERGY_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_TESTS_ADDED_ENERGY_INL_H
#undef VARIMESH_TESTS_ADDED_ENERGY_INL_H
#else
#define VARIMESH_TESTS_ADDED_ENERGY_INL_H
#endif

#include "core/energy/jacobian-inl.h"
#include "core/energy/material.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

template <int d>
struct AddedEnergy : EnergyProperties {
  explicit AddedEnergy(const Material&) {}

  /// f = (Q − d)/2 + 1/J' − 1
  template <class T>
  HWY_INLINE T value(T Q, const Regularised<T>& j) const {
    return number<T>(0.5) * (Q - number<T>(d)) + number<T>(1) / j.positive - number<T>(1);
  }

  /// f_Q = 1/2,  f_J = −1/(J' s),  f_JJ = 2/s³
  template <class T>
  HWY_INLINE Partials<T> partials(T Q, const Regularised<T>& j) const {
    const T zero = number<T>(0), one = number<T>(1);
    const T inverse_s = one / j.s;
    return {value(Q, j), number<T>(0.5), negative(inverse_s) / j.positive,
            zero,        zero,           number<T>(2) * inverse_s * inverse_s * inverse_s};
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
