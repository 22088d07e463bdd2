// Quadruple precision as a number type for the energies. Finite differences in double precision are too coarse near
// J = 0.
#pragma once

#include <quadmath.h>

#include <utility>

namespace quad {

struct Quad {
  __float128 v = 0;
};
inline Quad operator+(Quad a, Quad b) { return {a.v + b.v}; }
inline Quad operator-(Quad a, Quad b) { return {a.v - b.v}; }
inline Quad operator*(Quad a, Quad b) { return {a.v * b.v}; }
inline Quad operator/(Quad a, Quad b) { return {a.v / b.v}; }
inline Quad logarithm(Quad x) { return {logq(x.v)}; }
inline Quad inverse_cube_root(Quad x) { return {1 / cbrtq(x.v)}; }
inline Quad square_root(Quad x) { return {sqrtq(x.v)}; }
inline Quad where_negative(Quad x, Quad then, Quad otherwise) { return x.v < 0 ? then : otherwise; }
inline Quad negative(Quad x) { return {-x.v}; }
inline Quad fused(Quad a, Quad b, Quad c) { return {a.v * b.v + c.v}; }

}  // namespace quad
