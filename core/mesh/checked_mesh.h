// A mesh that has passed the checks, with what they found, so that nobody finds it again.
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/error.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/mesh/plane.h"

namespace varimesh {

/// A mesh that has passed check_structure(), or check_judgeable() if it is only to be judged. Whoever changes which
/// nodes its cells have must check it again.
struct CheckedMesh {
  HighOrderMesh mesh;
  Facets facets;       ///< Of the mesh. Without entries if the mesh is a surface in space.
  double seconds = 0;  ///< What the check took.
  /// If the mesh came in a plane that is not z = constant, and is to be optimised: the plane. `mesh` lies in z = 0
  /// then.
  std::optional<Plane> plane{};
};

/// Which meshes pass: those that can be optimised, or those that can be judged.
enum class CheckFor : std::uint8_t { Optimising, Judging };

/// Checks a mesh. One that is to be optimised and lies in any plane in space is put into z = 0. Errors: BadInput, as
/// check_structure() or check_judgeable(). Do not call it inside team.run().
Expected<CheckedMesh> check_mesh(HighOrderMesh mesh, CheckFor purpose, const Team& team);

}  // namespace varimesh
