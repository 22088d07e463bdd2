// Slides the boundary nodes of a mesh on its geometry, bottom-up: curves first, then surfaces. Internal to the library.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/association/association.h"

namespace varimesh {

/// Which nodes slide.
enum class SlideOn : std::uint8_t {
  None,      ///< None: the mesh is only associated with the geometry.
  Surfaces,  ///< Nodes on surfaces. Those on curves stay.
  All,       ///< Nodes on curves, then nodes on surfaces.
};

/// The word for a SlideOn: none, surfaces or all. Errors: BadOption, which lists the words.
Expected<SlideOn> slide_on_from_name(std::string_view name);

/// The distance between the curved boundary and the geometry, sampled between the nodes, in the mesh's unit of length.
struct BoundaryDistance {
  double largest = 0;
  double rms = 0;
};

/// What came of sliding.
struct SlideReport {
  std::int64_t nodes = 0;          ///< How many nodes moved.
  double farthest = 0;             ///< The largest movement of a node, in the mesh's unit of length.
  std::int64_t folded_before = 0;  ///< Surface elements that are folded over at a sample.
  std::int64_t folded_after = 0;
  int curves = 0, surfaces = 0;  ///< On how many entities nodes moved.
  /// On how many the nodes moved less than they would, or stayed: see slide(). Those that stood at their optimum from
  /// the start do not count.
  int held_back = 0;
  BoundaryDistance before, after;

  /// Two sentences for a person.
  std::string sentence(double size) const;
};

/// Slides nodes until the elements on each curve and surface are as even as their straight-sided forms (core/slide's
/// energy; entity_energy.h has the formula). The elements inside the mesh are not looked at: the caller optimises them
/// afterwards with the boundary fixed. All nodes that move are on their entity afterwards, up to rounding. Vertices,
/// nodes of `fixed`, nodes at poles and nodes that belong to no entity for sure stay.
///
/// No curve and no surface is farther from its elements afterwards (largest and rms distance between the nodes), none
/// has more folded elements, and no node leaves its surface through the boundary. If the optimum would do so, the nodes
/// of an entity go only a half, a quarter or an eighth of the way, or stay. The nodes on a surface may make use of what
/// its curves have left: its distances may reach those at the start or, if these are larger, those after the curves'
/// nodes have moved. If a surface is then worse than at the start, the nodes of its curves go back, and the surfaces
/// around try again.
///
/// The result does not depend on the number of threads. Call it inside team.run().
SlideReport slide(HighOrderMesh& mesh, Association& association, SlideOn what, const std::vector<bool>& fixed,
                  const Team& team);

}  // namespace varimesh
