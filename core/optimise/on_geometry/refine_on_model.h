// Splits and swaps edges on the boundary of a mesh that has been optimised, with new nodes on a model. Internal to
// core/optimise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/on_geometry/optimise_on_geometry.h"
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
  bool is_full = false;            ///< Refining would have split more, but the mesh may not grow so far.
  std::set<std::string> surfaces;  ///< At which surfaces of the model, as Surface::number_text().
  std::vector<RepairStep> steps;   ///< One for each edge.
};

/// Whether the mesh has elements whose edges can be split.
bool may_be_split(const HighOrderMesh& mesh);

/// Swaps edges of these elements that no split can help (core/repair/boundary/boundary_swaps.h), or if there are none,
/// splits edges (core/repair/boundary/refine.h), and adds to `done`. Returns how many. `options.fix`, `threads` and
/// `stop` are looked at. Errors: those of associate(). Throws Interrupted if the work is to stop; the mesh is then as
/// it came.
/// @param wanted      numbers of elements, in ascending order
/// @param most_cells  how many the mesh may have
Expected<std::size_t> refine_on_model(HighOrderMesh& mesh, const GeometryOptions& options,
                                      const geometry::Geometry& model, const std::vector<std::int64_t>& wanted,
                                      std::size_t most_cells, Refinement& done);

/// The steps without RepairStep::Kind::Left.
std::vector<RepairStep> splits_of(std::vector<RepairStep> steps);

/// Replaces the best mesh so far by a mesh that was made from it. What is said about the mesh as it came stays.
void take_refined(ResultOnGeometry& best, Result&& other, std::optional<SlidAndMeasured>&& slid);

/// Sentences for a person: what refining has done, whether it ended because the mesh may not have more elements, and
/// whether the boundary lies farther from the model now. Empty if there is nothing to say.
/// @param done     nothing: the best mesh was not refined
/// @param came     the mesh as it came
/// @param full_at  how many cells the mesh may have, if refining ended at this limit; else 0
/// @param slid     what came of sliding; null: not known
std::string refining_sentence(const std::optional<Refinement>& done, const HighOrderMesh& came, const Result& best,
                              std::size_t full_at, const SlideReport* slid);

/// A sentence for a person about cusps of the model at elements that are not certified valid
/// (core/repair/boundary/cusps.h). Empty if there are none, without a model, if the search is stopped, and if there is
/// no memory for it.
/// @param seconds     that are left to the run; 0: no limit. The search has half a second, and 20 s for a million
///                    cells, even if less is left: elements at a cusp often use up all the time.
/// @param stop_asked  whether the caller asks for a stop; may be empty
std::string cusps_sentence(const Result& best, const geometry::Geometry* model, int threads, double seconds,
                           const std::function<bool()>& stop_asked);

/// How far from the model the boundary may lie in all rounds of refining together, where all nodes move together.
/// @param slid  what came of sliding before
double most_distance_in_rounds(const SlideReport& slid);

}  // namespace varimesh
