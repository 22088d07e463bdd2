// Shapes that stand in for straight-sided cells that are inverted or nearly flat, so that such cells have a target too.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/connectivity.h"

namespace varimesh {

/// The cells whose target is not made from their own vertices, and the vertices that it is made from.
struct SubstituteShapes {
  /// The vertices of a straight-sided cell in Gmsh's order: x y z each, in the mesh's unit of length, up to a
  /// translation.
  using Vertices = std::array<std::array<double, 3>, 8>;

  std::vector<std::int32_t> cells;  ///< Numbers of the cells in the mesh's order, ascending.
  std::vector<Vertices> vertices;   ///< One entry for each of them.

  /// Null if the cell keeps its own vertices.
  const Vertices* of(std::int32_t cell) const;
};

/// Finds the cells whose straight-sided form is inverted or nearly flat, and gives each a sound shape.
///
/// Inverted: `sound` says so. Nearly flat: at no corner do the unit vectors along the edges have a determinant above
/// 0.05, and straight sides enclose less than a tenth of what the curved cell encloses. A thin cell of a boundary layer
/// is not flat in this sense: its short edges stand on its long ones.
///
/// The substitute is the regular shape (targets.h), turned by the polar factor of the curved cell's mean gradient. Its
/// volume is the volume that the curved cell encloses, ∫ det ∇χ_M. If this is below a hundredth of the mean volume of
/// the neighbours across facets, its volume is this mean. Only positive volumes count; if no neighbour has one, the
/// mean is over all cells.
///
/// @param facets of the mesh
/// @param sound  by cell, Certifier::sound_with_straight_sides()
/// Call it inside team.run(). The result does not depend on the number of threads.
SubstituteShapes substitute_shapes(const HighOrderMesh& mesh, const Facets& facets, const std::vector<char>& sound,
                                   const Team& team);

}  // namespace varimesh
