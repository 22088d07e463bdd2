// What came of sliding boundary nodes.
#pragma once

#include <cstdint>
#include <string>

namespace varimesh {

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

}  // namespace varimesh
