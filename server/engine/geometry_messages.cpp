#include "server/engine/geometry_messages.h"

#include <cmath>
#include <string>

namespace varimesh::server {
namespace {

constexpr double kMostDegrees = 45;

v1::BoundaryDistance to_proto(const BoundaryDistance& distance) {
  v1::BoundaryDistance message;
  message.set_largest(distance.largest);
  message.set_rms(distance.rms);
  return message;
}

}  // namespace

Expected<void> check(const v1::Geometry& geometry, const Options& options) {
  if (!v1::Geometry::Slide_IsValid(geometry.slide()))
    return bad_option("geometry.slide is " + std::to_string(static_cast<int>(geometry.slide())) +
                      ", but this server knows only none, surfaces, all and coupled.");
  if (!(geometry.smooth_angle() >= 0 && geometry.smooth_angle() <= kMostDegrees))
    return bad_option("geometry.smooth_angle must be from 0 to 45 degrees.");
  if (!(geometry.tolerance() >= 0 && std::isfinite(geometry.tolerance())))
    return bad_option("geometry.tolerance must be a length, or 0.");
  if (geometry.tolerance() > 0 && geometry.slide() != v1::Geometry::SLIDE_COUPLED)
    return bad_option("geometry.tolerance goes only with slide coupled.");
  if (options.order > 0)
    return bad_option("order does not go with a geometry, because new boundary nodes would not lie on it.");
  if (!options.free.empty() || !options.free_nodes.empty() || !options.fix_nodes.empty() || options.region_below > 0)
    return bad_option("A geometry goes only with fix, not with other options that fix or free nodes.");
  return {};
}

GeometryOptions geometry_options(const v1::Geometry& geometry, const Options& options) {
  GeometryOptions all;
  all.slide = geometry.slide() == v1::Geometry::SLIDE_NONE       ? "none"
              : geometry.slide() == v1::Geometry::SLIDE_SURFACES ? "surfaces"
              : geometry.slide() == v1::Geometry::SLIDE_COUPLED  ? "coupled"
                                                                 : "all";
  all.tolerance = geometry.tolerance();
  all.coupled_seconds = options.time_limit / 2;
  all.snap = geometry.snap();
  all.smooth_angle = geometry.smooth_angle();
  all.fix = options.fix;
  all.threads = options.threads;
  return all;
}

v1::GeometryReport to_proto(const SlidOnGeometry& slid) {
  v1::GeometryReport message;
  for (const std::string& sentence : slid.sentences) message.add_sentences(sentence);
  message.set_nodes(slid.report.nodes);
  message.set_farthest(slid.report.farthest);
  message.set_folded_before(slid.report.folded_before);
  message.set_folded_after(slid.report.folded_after);
  *message.mutable_before() = to_proto(slid.report.before);
  *message.mutable_after() = to_proto(slid.report.after);
  return message;
}

}  // namespace varimesh::server
