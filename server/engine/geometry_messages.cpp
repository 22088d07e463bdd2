#include "server/engine/geometry_messages.h"

#include <algorithm>
#include <string>

#include "server/engine/option_messages.h"

namespace varimesh::server {
namespace {

v1::BoundaryDistance to_proto(const BoundaryDistance& distance) {
  v1::BoundaryDistance message;
  message.set_largest(distance.largest);
  message.set_rms(distance.rms);
  return message;
}

v1::SurfaceDistance to_proto(const SurfaceDistance& one, bool has_before) {
  v1::SurfaceDistance message;
  message.set_surface(one.surface);
  message.set_name(one.name);
  message.mutable_tags()->Add(one.tags.begin(), one.tags.end());
  message.set_elements(one.elements);
  if (has_before) *message.mutable_before() = to_proto(one.before);
  *message.mutable_after() = to_proto(one.after);
  message.set_folded_before(one.folded_before);
  message.set_folded_after(one.folded_after);
  return message;
}

void add(const BoundaryDistances& distances, v1::GeometryReport& report) {
  for (std::size_t i = 0; i < std::min(kMostSurfaces, distances.surfaces.size()); ++i)
    *report.add_surfaces() = to_proto(distances.surfaces[i], !distances.before.empty());
  if (distances.elements.size() > kMostElementsMeasured) return;
  v1::ElementDistances& elements = *report.mutable_elements();
  elements.mutable_numbers()->Add(distances.elements.begin(), distances.elements.end());
  elements.mutable_surfaces()->Add(distances.surface_of_element.begin(), distances.surface_of_element.end());
  elements.mutable_before()->Add(distances.before.begin(), distances.before.end());
  elements.mutable_after()->Add(distances.after.begin(), distances.after.end());
}

}  // namespace

Expected<void> check(const v1::Geometry& geometry, const Options& options) {
  auto own = options_from(geometry);
  if (!own) return bad_option(own.error().sentence);
  own->file = geometry.digest();  // stands for the model
  if (auto fine = check(*own); !fine) return fine;
  if (options.repair == Repair::Refine && own->on_boundary())
    return bad_option("repair is refine, which needs a model for its new nodes; choose split, or give a model.");
  if (options.order > 0)
    return bad_option(
        "order does not go with a geometry, because the new boundary nodes would not lie on the geometry.");
  if (!options.free.empty() || !options.free_nodes.empty() || !options.fix_nodes.empty() || options.region_below > 0)
    return bad_option("A geometry goes only with fix, not with other options that fix or free nodes.");
  return {};
}

v1::SlideTrial to_proto(const SlideTrial& trial) {
  v1::SlideTrial message;
  message.set_slide(static_cast<v1::SlideTrial::Slide>(static_cast<int>(trial.slide) + 1));
  message.set_outcome(static_cast<v1::SlideTrial::Outcome>(static_cast<int>(trial.outcome) + 1));
  message.set_left_before(trial.left_before);
  message.set_min_scaled_jacobian_before(trial.min_scaled_jacobian_before);
  message.set_left(trial.left);
  message.set_min_scaled_jacobian(trial.min_scaled_jacobian);
  message.set_error(trial.error);
  return message;
}

v1::GeometryReport to_proto(const SlidAndMeasured& done) {
  const SlidOnGeometry& slid = done.slid;
  v1::GeometryReport message;
  for (const std::string& sentence : slid.sentences) message.add_sentences(sentence);
  message.set_nodes(slid.report.nodes);
  message.set_farthest(slid.report.farthest);
  message.set_folded_before(slid.report.folded_before);
  message.set_folded_after(slid.report.folded_after);
  message.set_straight_elements(slid.straight_elements);
  if (!slid.is_cut_short) {  // otherwise they were not measured
    *message.mutable_before() = to_proto(slid.report.before);
    *message.mutable_after() = to_proto(slid.report.after);
  }
  if (done.distances) add(*done.distances, message);
  return message;
}

}  // namespace varimesh::server
