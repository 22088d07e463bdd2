// What a user can choose about a geometry on which boundary nodes slide. The contract, the flags and the documentation
// use the same names.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/stop_token.h"

namespace varimesh {

/// Which nodes slide.
enum class SlideOn : std::uint8_t {
  None,      ///< None: the mesh is only associated with the geometry.
  Surfaces,  ///< Nodes on surfaces. Those on curves stay.
  All,       ///< Nodes on curves, then nodes on surfaces.
  Coupled,   ///< The same, and then all nodes of the mesh together, those inside it included.
  Auto,      ///< As All. A run that leaves elements goes on with Coupled and None (optimise_on_geometry.h).
};

/// What they slide on.
enum class GeometrySource : std::uint8_t {
  Model,     ///< A CAD model.
  Boundary,  ///< The mesh's own curved boundary as it came.
};

/// geometry_option_table() has the range of each option.
struct GeometryOptions {
  GeometrySource slide_on = GeometrySource::Model;
  SlideOn slide = SlideOn::Auto;
  /// With SlideOn::Coupled: how far the boundary may lie from the geometry, in the mesh's unit of length. 0: twice as
  /// far as it does.
  double tolerance = 0;
  bool snap = false;  ///< First move nodes that are off their curve, surface or vertex onto it.
  /// Nodes cross joints at which surfaces or curves meet at no more than this angle, in degrees; 0: none.
  double smooth_angle = 0;
  /// With Repair::Refine, which splits edges on the boundary: the number of elements that the mesh may have, divided by
  /// their number in the input.
  double growth = 1.5;
  int order = 0;  ///< 0: the mesh is curved. Otherwise it is of order 1 and is first curved with this order.

  // What follows is no option of the table. A run takes it from Options.

  std::string file;  ///< A STEP, IGES or BREP file; empty: none.
  /// With SlideOn::Coupled: for how long all nodes may move together, in seconds. 0: no limit.
  double coupled_seconds = 0;
  /// A node is off if it is farther than this from its entity, relative to the diagonal of the boundary's box.
  double snap_tolerance = 1e-6;
  std::vector<std::string> fix;     ///< Physical groups whose nodes stay, by name, by tag, or by "dimension:tag".
  int threads = 1;                  ///< 0: as many as the machine has.
  const StopToken* stop = nullptr;  ///< May stop the work; may be null.

  bool on_boundary() const { return slide_on == GeometrySource::Boundary; }
  bool any() const { return on_boundary() || !file.empty(); }
};

/// Checks ranges and combinations that do not depend on the mesh. Errors: BadOption.
Expected<void> check(const GeometryOptions& options);

}  // namespace varimesh
