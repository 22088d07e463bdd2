#include "core/distance/slide_and_measure.h"

#include <utility>

#include "core/geometry/load.h"

namespace varimesh {

Expected<SlidAndMeasured> slide_and_measure(HighOrderMesh& mesh, const GeometryOptions& options,
                                            const geometry::Geometry& model) {
  // Sliding changes places and parameters of nodes. Curving changes all.
  const bool curves = options.order > 0;
  std::vector<double> coordinates;
  std::vector<NodeBlock> parameters;
  if (!curves) {
    coordinates = mesh.coordinates;
    parameters = mesh.node_blocks;
  }
  auto slid = slide_on_model(mesh, options, model);
  if (!slid) return tl::unexpected(slid.error());
  SlidAndMeasured result{std::move(*slid), {}};
  if (curves) coordinates = mesh.coordinates;
  const auto change_places = [&] {
    std::swap(coordinates, mesh.coordinates);
    if (!curves) std::swap(parameters, mesh.node_blocks);
  };
  Team team(options.threads);
  team.set_stop(options.stop);
  Expected<BoundaryDistances> measured;
  change_places();
  try {
    const double joined = options.slide == "none" || curves ? 0 : options.smooth_angle;
    team.run([&] { measured = boundary_distances(mesh, coordinates, model, joined, team); });
    if (measured) result.distances = std::move(*measured);
  } catch (const Interrupted&) {
  }
  change_places();
  if (!result.distances) return result;
  if (curves) result.distances->forget_before();
  for (std::string& sentence : result.distances->sentences()) result.slid.sentences.push_back(std::move(sentence));
  return result;
}

Expected<SlidAndMeasured> slide_and_measure(HighOrderMesh& mesh, const GeometryOptions& options) {
  const auto model = geometry::load(options.file);
  if (!model) return tl::unexpected(model.error());
  return slide_and_measure(mesh, options, *model);
}

}  // namespace varimesh
