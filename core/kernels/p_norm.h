// The p-norm over the cells of any energy, which weights the worst cells more.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "core/kernels/kernels.h"

namespace varimesh {

/// Σ_e V_e (E_e/V_e)^p, with E_e = ∫ W |det A| and V_e = ∫ |det A| over cell e. Minimising it minimises the p-norm of
/// the cells' mean energies, weighted by volume. p = 1 is the energy itself.
struct PNorm {
  double p = 1;

  bool is_sum() const { return p == 1; }
  /// The term of one cell, and its first and second derivatives with respect to E.
  double value(double E, double V) const { return is_sum() ? E : V * std::pow(mean(E, V), p); }
  double slope(double E, double V) const { return is_sum() ? 1 : p * std::pow(mean(E, V), p - 1); }
  double curvature(double E, double V) const { return is_sum() ? 0 : p * (p - 1) * std::pow(mean(E, V), p - 2) / V; }

 private:
  /// Energies are not negative, except for rounding at their minimum, 0.
  static double mean(double E, double V) { return std::max(E / V, 1e-12); }
};

/// Kernels::expand and Kernels::energy_after for the p-norm. With p ≠ 1 the Hessian is Σ slope H_e + curvature g_e g_eᵀ
/// over the star's cells, and the measure is Σ slope V_e, the factor of rounding errors in the cells' densities.
StarExpansion expand(const Kernels& kernels, std::span<const StarCell> star, const PNorm& norm);
double energy_after(const Kernels& kernels, std::span<const StarCell> star, const double* step, const PNorm& norm);

/// Σ weight |det A| over a cell.
double cell_measure(const CellSet& set, std::int32_t cell);

}  // namespace varimesh
