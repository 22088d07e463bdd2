// How well the elements in layers hold a solution that decays from the wall: an indicator that needs no solver.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The error of a mesh in its layers, dimensionless.
///
/// A solution in a boundary layer is nearly a function of n, the distance from the wall. The profiles
///
///     u_k = exp(−n/δ_k),   δ_k = 2ᵏ h ≤ H,   k = 0, 1, …
///
/// are as thin as the first layer, as thick as all layers, and in between: h is the height of the first layer above a
/// facet of the wall, and H is the height of all layers there. I u interpolates at the nodes, so ∇(u − I u) is what an
/// element of this shape cannot hold: because its nodes do not lie on surfaces parallel to the wall, because of how
/// they are spaced across the layer, or because of its size. With sums over the facets f of the walls and integrals
/// over the elements above each,
///
///     e_k² = Σ_f δ_k ∫|∇(u_k − I u_k)|² / Σ_f δ_k ∫|∇u_k|²,   e² = mean of e_k² over k.
///
/// Solutions that end faster, as those of Blasius and tanh do, are another matter: some meshes hold all exponentials
/// better and these worse. So there are errors e_k of the profiles erfc(n/δ_k), too.
///
/// It does not change if the mesh is moved, turned or scaled. The loss of accuracy (core/quality/accuracy) is about
/// waves and has another opinion about layers: it counts as a loss that an element follows the wall. docs/accuracy.md
/// compares both with the error of a solver.
struct LayerError {
  double error = 0;                 ///< e; 0 if the layers hold all these profiles exactly.
  std::int64_t cells = 0;           ///< Elements in layers.
  std::vector<double> of_profiles;  ///< e_k of exp and of erfc in turn, from the thinnest on.
};

/// Nothing if the mesh has no layers of thin elements at a wall, or if the Jacobian of an element in a layer is not
/// positive at a point of quadrature. Flat walls count in a mesh without layers at a curved one. Do not call it inside
/// team.run(). The team's token may interrupt it.
std::optional<LayerError> layer_error(const HighOrderMesh& mesh, const Facets& facets, const Team& team);

}  // namespace varimesh
