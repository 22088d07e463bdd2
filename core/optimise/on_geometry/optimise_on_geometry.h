// A run on a geometry: boundary nodes slide, the mesh is optimised, and other ways to slide are tried if that is not
// enough.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/optimise/optimiser.h"
#include "core/options/geometry_options.h"
#include "core/slide/distance/slide_and_measure.h"

namespace varimesh {
namespace geometry {
struct Geometry;
}  // namespace geometry

/// Another way to slide than the first, and what came of it.
struct SlideTrial {
  enum class Outcome : std::uint8_t {
    Running,   ///< It has begun.
    Taken,     ///< Its mesh is better than the best mesh so far, and takes its place.
    NoBetter,  ///< The best mesh so far stays.
    Failed,    ///< `error` says why. The best mesh so far stays.
    Stopped,   ///< The caller ended it. The best mesh so far stays.
  };
  SlideOn slide = SlideOn::None;
  Outcome outcome = Outcome::Running;
  /// The elements of the best mesh before the trial that are not certified valid, and the smallest scaled Jacobian of
  /// this mesh: the reason for the trial.
  std::int64_t left_before = 0;
  double min_scaled_jacobian_before = 0;
  /// The same figures of the trial's mesh, if the trial is Taken or NoBetter.
  std::int64_t left = 0;
  double min_scaled_jacobian = 0;
  std::string error;
};

/// Called from the thread of the run. Each may be empty.
struct OnGeometryHooks {
  /// What a person should know about the geometry and about sliding, in a sentence.
  std::function<void(const std::string&)> on_sentence;
  /// Called when a trial begins, and once more when it has ended.
  std::function<void(const SlideTrial&)> on_trial;
  /// How many threads sliding may use now; empty: as many as the optimisation.
  std::function<int()> threads_to_slide;
};

struct ResultOnGeometry {
  /// `seconds` and `proof_seconds` are sums over all runs, and `seconds` counts sliding and reading the model.
  /// `before`, `iterations` and `history` belong to the run whose mesh is the result.
  Result result;
  /// What came of sliding in this run. Nothing if no node was to slide, or if sliding was stopped.
  std::optional<SlidAndMeasured> slid;
  std::vector<SlideTrial> trials;
};

/// Slides the boundary nodes of a mesh of volume elements, or of a mesh in a plane, as `geometry` says, and optimises
/// the mesh with this boundary fixed. `geometry.fix`, `threads` and `coupled_seconds` are taken from `options` and
/// `control`. `Options::order` is 0; GeometryOptions::order curves a straight mesh.
///
/// On a model:
/// - If elements are left that are not certified valid, or have a scaled Jacobian below .02, and SlideOn::Auto lets
///   this function choose, a mesh of volume elements as it came is optimised with SlideOn::Coupled too.
/// - If elements are still left that are not certified valid, it is optimised with SlideOn::None too.
/// The result with the fewest elements left is taken, of several the first. If no element was left before all nodes
/// moved together, the result with the larger smallest scaled Jacobian is taken.
///
/// On the mesh's own boundary, the mesh is optimised with its boundary as it came too. Of two results with as many
/// elements left, the one with the larger smallest scaled Jacobian is taken.
///
/// With SlideOn::None there is one run. Options::time_limit is for everything together. While another run may follow, a
/// run leaves a quarter of what is left to it, and sliding leaves a quarter of its run's time to the optimisation. A
/// run that leaves elements does not lower the loss of accuracy either (RunControl::another_follows). At the end, the
/// best mesh is optimised once more in the time that is left, with its boundary fixed, if its own run had not enough.
/// Options::max_iterations is for each run. Iterations are numbered through for `on_iteration`. No run begins after the
/// caller has asked for a stop.
///
/// A checkpoint has the last checkpoint of each run. A run that goes on from it slides again, and runs that were
/// finished go on from their last checkpoints; so it ends with the same bytes.
///
/// Errors: those of slide_on_file() and optimise(), if the first run has them.
///
/// @param model  what GeometryOptions::file would be read as; null: GeometryOptions::on_boundary(), or the file is read
Expected<ResultOnGeometry> optimise_on_geometry(HighOrderMesh mesh, const Options& options,
                                                const GeometryOptions& geometry,
                                                const geometry::Geometry* model = nullptr,
                                                const OnIteration& on_iteration = {}, const RunControl& control = {},
                                                const OnGeometryHooks& hooks = {});

/// The bytes that optimise_on_geometry() has in use at most, except for the model: an estimate, as memory_needed().
std::int64_t memory_needed_on_geometry(const HighOrderMesh& mesh, const Options& options,
                                       const GeometryOptions& geometry);

}  // namespace varimesh
