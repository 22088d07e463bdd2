// An energy and its constants, with every default resolved: what the kernels are told.
#pragma once

#include <string_view>

#include "core/options/options.h"

namespace varimesh {

/// An energy as the kernels take it. All constants are dimensionless and set.
struct Material {
  Energy energy = Energy::Hyperelastic;
  Strain strain = Strain::GreenLagrange;
  Volumetric volumetric = Volumetric::Log;
  Winslow winslow = Winslow::True;
  double mu = 0;      ///< Shear modulus.
  double lambda = 0;  ///< First Lamé constant (hyperelastic; linear elastic with the trace form).
  double kappa = 0;   ///< Bulk modulus (linear elastic with the logarithm).
};

/// The reference constants: those of the reference implementation (the varopti module of NekMesh), ν = 0.4:
/// μ = 1/(2(1 + ν)) and K = 1/(3(1 − 2ν)) in place of both λ and κ.
inline constexpr double kReferenceMu = 1 / 2.8;
inline constexpr double kReferenceBulk = 1 / 0.6;

/// Of the standard constants: λ of the hyperelastic energy. Measured: the lowest scaled Jacobian of the test cases
/// rises by .01 to .18 against the reference constants, at about twice the Hessian products.
inline constexpr double kStandardLambda = 10;

/// The material that the options ask for: constants that are 0 come from options.constants.
Material material(const Options& options);

/// The name in flags and documents: "hyperelastic", "linear-elastic", "winslow", "distortion".
std::string_view name(Energy energy);

}  // namespace varimesh
