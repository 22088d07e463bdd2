// What a user can choose about an optimisation. The same names stand in the proto, the flags and the documentation.
#pragma once

#include <cstdint>

#include "core/error.h"

namespace varimesh {

enum class Energy : std::uint8_t { Hyperelastic, LinearElastic, Winslow, Distortion };
enum class Strain : std::uint8_t {
  GreenLagrange,  ///< E = (FᵀF − 1)/2, invariant under rotation.
  Small,          ///< E = sym F − 1, the paper's; its result depends on how the mesh is rotated.
};
enum class Volumetric : std::uint8_t {
  Log,    ///< κ/2 (ln J)²
  Trace,  ///< λ/2 (tr E)², the classical form: no barrier, so it cannot keep a mesh valid.
};
enum class Winslow : std::uint8_t {
  True,   ///< |cof F|²/J in 3-D (in 2-D the same as the paper's).
  Paper,  ///< |F|²/J, which in 3-D is not the Winslow functional.
};
enum class Constants : std::uint8_t {
  Reference,  ///< μ = 1/2.8, λ = κ = 1/0.6: those of the reference implementation (NekMesh), ν = 0.4.
};
enum class Regularisation : std::uint8_t {
  Element,  ///< One δ an element, from its own smallest J.
  Patch,    ///< One δ a node's patch, from the patch's smallest J, as in the paper.
};
enum class Method : std::uint8_t {
  Auto,    ///< Sweeps until every cell is valid (or no more become so), then Newton: the default.
  Sweeps,  ///< Node-wise Newton in coloured parallel sweeps, as in the paper.
  Newton,  ///< All nodes at once: truncated Newton with matrix-free conjugate gradients.
};
enum class Colouring : std::uint8_t {
  Group,  ///< Colour whole groups: the interior nodes of an element, a face, an edge, a vertex.
  Node,   ///< Colour single nodes, as in the paper's section 3.4.
};

/// Settings of an optimisation; the defaults suit most meshes.
struct Options {
  Energy energy = Energy::Hyperelastic;
  Strain strain = Strain::GreenLagrange;       ///< Linear elastic only.
  Volumetric volumetric = Volumetric::Log;     ///< Linear elastic only.
  Winslow winslow = Winslow::True;             ///< Winslow in 3-D only.
  Constants constants = Constants::Reference;  ///< The set that mu, lambda and kappa come from where they are 0.
  double mu = 0;                               ///< Shear modulus, dimensionless; 0: from `constants`.
  double lambda = 0;                           ///< First Lamé constant, dimensionless; 0: from `constants`.
  double kappa = 0;                            ///< Bulk modulus, dimensionless; 0: from `constants`.
  Regularisation regularisation = Regularisation::Element;
  Method method = Method::Auto;
  Colouring colouring = Colouring::Group;
  double tolerance = 1e-6;    ///< Stop when the residual, relative to the bounding box's diagonal, is below this.
  int max_iterations = 1000;  ///< Stop after this many iterations; 0 checks and reports only.
  int threads = 0;            ///< Threads to use; 0: all of the machine's.
  int quadrature_degree = 0;  ///< Degree integrated exactly; 0: 2 P. Not under 2 (P − 1) on simplices.
};

/// Checks ranges and combinations that do not depend on the mesh. Errors: BadOption, naming the option and its range.
Expected<void> check(const Options& options);

}  // namespace varimesh
