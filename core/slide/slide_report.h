// Which boundary nodes slide, and what came of it. Internal to the library.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace varimesh {

/// Which nodes slide.
enum class SlideOn : std::uint8_t {
  None,      ///< None: the mesh is only associated with the geometry.
  Surfaces,  ///< Nodes on surfaces. Those on curves stay.
  All,       ///< Nodes on curves, then nodes on surfaces.
  Coupled,   ///< The same, and then all nodes of the mesh together, those inside it included.
};

/// The word for a SlideOn: none, surfaces, all or coupled. Errors: BadOption, which lists the words.
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

}  // namespace varimesh
