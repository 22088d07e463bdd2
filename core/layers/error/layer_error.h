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
/// Some solutions are nearly linear at the wall and end within a few δ, such as Blasius' profile. A mesh may hold all
/// exponentials better and these worse. So e_k is also computed for erfc(n/δ_k), from k = 1 on: erfc(n/h) ends within
/// the first layer.
///
/// It does not change if the mesh is moved, turned or scaled. The loss of accuracy (core/quality/accuracy) is about
/// waves and has another opinion about layers: it counts as a loss that an element follows the wall. docs/accuracy.md
/// compares both with the error of a solver.
struct LayerError {
  double error = 0;                 ///< e, of the exponentials only.
  std::int64_t cells = 0;           ///< Elements in layers.
  std::vector<double> of_profiles;  ///< e_0 of exp, e_1 of erfc, e_1 of exp, e_2 of erfc, and so on.
};

/// Nothing if the mesh has no layers of thin elements at a wall, or if the Jacobian of an element in a layer is not
/// positive at a point of quadrature. Flat walls count in a mesh without layers at a curved one. Do not call it inside
/// team.run(). The team's token may interrupt it.
/// @param as_it_came  if it is not null, its layers and profiles count, so that the errors of both meshes can be
///                    compared: it has the same elements, and its nodes lie elsewhere, but not those of the wall
std::optional<LayerError> layer_error(const HighOrderMesh& mesh, const Facets& facets, const Team& team,
                                      const HighOrderMesh* as_it_came = nullptr);

}  // namespace varimesh
