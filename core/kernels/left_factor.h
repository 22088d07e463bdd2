// The directions of a metric: the left factor in the deformation gradient of a cell that has one.
//
// F = L ∇χ_M A⁻¹ with a symmetric L of determinant 1. If the node moves by a, F changes by L a ⊗ g instead of a ⊗ g. So
// every formula without L holds for the step L a, and its gradient g and Hessian H become L g and L H L.
#pragma once

#include <span>

#include "core/kernels/kernels.h"

namespace varimesh {

/// out = L x, both d numbers; `factor` is L, row-major, or null for 1.
inline void times_left_factor(const double* factor, int d, const double* x, double* out) {
  for (int i = 0; i < d; ++i) {
    out[i] = factor == nullptr ? x[i] : factor[i * d] * x[0];
    for (int k = 1; k < d && factor != nullptr; ++k) out[i] += factor[i * d + k] * x[k];
  }
}

/// Kernels::expand and energy_after for stars with left factors. They call the kernels for one cell after another,
/// without its left factor.
StarExpansion expand_through_left_factors(const Kernels& kernels, int d, std::span<const StarCell> star);
double energy_through_left_factors(const Kernels& kernels, int d, std::span<const StarCell> star, const double* step);

}  // namespace varimesh
