#include "core/slide/distance/slide_and_measure.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/geometry/load.h"
#include "core/validity/certifier.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

/// How many cells are not certified valid. Inside team.run().
std::ptrdiff_t uncertified(const HighOrderMesh& mesh, const Team& team) {
  const detail::OrientedMesh oriented(mesh, team);
  const Certifier certifier(oriented.mesh(), {}, team);
  std::vector<Certificate> certificates(certifier.cells());
  certifier.certify(mesh.coordinates, certificates, team);
  return std::ranges::count_if(certificates, [](const Certificate& certificate) { return !certificate.is_valid(); });
}

std::string as_it_came_text(std::ptrdiff_t count) {
  return "In the input, " + std::to_string(count) + (count == 1 ? " element was" : " elements were") +
         " not certified valid. The figures before the optimisation describe the mesh after sliding.";
}

}  // namespace

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
  if (result.slid.in_plane) return result;
  if (curves) coordinates = mesh.coordinates;
  const auto change_places = [&] {
    std::swap(coordinates, mesh.coordinates);
    if (!curves) std::swap(parameters, mesh.node_blocks);
  };
  Team team(options.threads);
  team.set_stop(options.stop);
  Expected<BoundaryDistances> measured;
  const bool says_what_came = !curves && mesh.dimension == 3 && coordinates != mesh.coordinates;
  std::optional<std::ptrdiff_t> came;
  change_places();
  try {
    const double joined = options.slide == SlideOn::None || curves ? 0 : options.smooth_angle;
    team.run([&] { measured = boundary_distances(mesh, coordinates, model, joined, team); });
    if (measured) result.distances = std::move(*measured);
    if (says_what_came) team.run([&] { came = uncertified(mesh, team); });
  } catch (const Interrupted&) {
  }
  change_places();
  if (!result.distances) return result;
  if (curves) result.distances->forget_before();
  for (std::string& sentence : result.distances->sentences()) result.slid.sentences.push_back(std::move(sentence));
  if (came) result.slid.sentences.push_back(as_it_came_text(*came));
  return result;
}

Expected<SlidAndMeasured> slide_and_measure(HighOrderMesh& mesh, const GeometryOptions& options) {
  const auto model = geometry::load(options.file);
  if (!model) return tl::unexpected(model.error());
  return slide_and_measure(mesh, options, *model);
}

}  // namespace varimesh
