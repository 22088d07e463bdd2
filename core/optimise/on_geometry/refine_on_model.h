// Splits and swaps edges on the boundary of a mesh that has been optimised, with new nodes on a model. Internal to
// core/optimise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/options/geometry_options.h"
#include "core/repair/repair_step.h"
#include "core/slide/slide_report.h"

namespace varimesh {
namespace geometry {
struct Geometry;
}  // namespace geometry

/// What refining has done so far.
struct Refinement {
  std::size_t edges = 0;           ///< How many were split.
  std::size_t swapped = 0;         ///< How many were swapped.
  bool is_full = false;            ///< The mesh may not grow as far as it would have.
  std::set<std::string> surfaces;  ///< At which surfaces of the model, as Surface::number_text().
  std::vector<RepairStep> steps;   ///< One for each edge.

  /// For a person.
  /// @param before, after  how many elements the mesh had, and has
  std::string sentence(std::size_t before, std::size_t after) const;
};

/// For a person, if refining ends because the mesh may not have more elements than these.
std::string full_sentence(std::size_t most_cells);
/// A space and a sentence for a person, if the boundary of the refined mesh lies farther from the model than that which
/// came; else nothing.
std::string farther_sentence(const SlideReport& report);

/// Swaps edges of these elements that no split can help (core/repair/boundary/boundary_swaps.h), or if there are none,
/// splits edges (core/repair/boundary/refine.h), and adds to `done`. Returns how many. `options.fix`, `threads` and
/// `stop` are looked at. Errors: those of associate(). Throws Interrupted if the work is to stop; the mesh is then as
/// it came.
/// @param wanted      numbers of elements, in ascending order
/// @param most_cells  how many the mesh may have
Expected<std::size_t> refine_on_model(HighOrderMesh& mesh, const GeometryOptions& options,
                                      const geometry::Geometry& model, const std::vector<std::int64_t>& wanted,
                                      std::size_t most_cells, Refinement& done);

}  // namespace varimesh
