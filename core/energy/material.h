// An energy with its form and constants, as the kernels use it: all defaults are resolved.
#pragma once

#include <string_view>

#include "core/options/options.h"

namespace varimesh {

/// An energy with its form and constants. All constants are dimensionless and positive.
struct Material {
  Energy energy = Energy::Hyperelastic;
  Strain strain = Strain::GreenLagrange;
  Volumetric volumetric = Volumetric::Log;
  Winslow winslow = Winslow::True;
  double mu = 0;      ///< Shear modulus.
  double lambda = 0;  ///< First Lamé constant (hyperelastic; linear elastic with the trace form).
  double kappa = 0;   ///< Bulk modulus (linear elastic with the logarithm).
};

/// The constants of the reference implementation (the varopti module of NekMesh), with ν = 0.4: μ = 1/(2(1 + ν)), and
/// K = 1/(3(1 − 2ν)) for both λ and κ.
inline constexpr double kReferenceMu = 1 / 2.8;
inline constexpr double kReferenceBulk = 1 / 0.6;

/// The λ of the hyperelastic energy among the standard constants. Measured: compared with the reference constants, the
/// lowest scaled Jacobian of the test cases is higher by .01 to .18, for about twice as many Hessian products.
inline constexpr double kStandardLambda = 10;

/// The material that the options choose. Constants that are 0 come from options.constants.
Material material(const Options& options);

/// Whether W → ∞ as J → 0, so that the energy keeps valid elements valid.
bool has_barrier(const Material& material);

/// Whether the energy depends on λ or κ.
bool has_bulk_constant(const Material& material);

/// The energy's name in flags and documents, from the table of options.
std::string_view name(Energy energy);

}  // namespace varimesh
