// The geometry of a job: its options, and what came of it.
#pragma once

#include "core/base/error.h"
#include "core/optimise/on_geometry/optimise_on_geometry.h"
#include "core/options/options.h"
#include "core/slide/distance/slide_and_measure.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// Whether a job with these options can have this geometry. Errors: BadOption.
Expected<void> check(const v1::Geometry& geometry, const Options& options);

/// Why an engine without a process for it reads no CAD files.
inline tl::unexpected<Error> takes_no_models() {
  return bad_option(
      "This server takes no CAD models, because it runs jobs in its own process, which a damaged CAD file could crash; "
      "start it so that it runs them in processes of their own (the default of varimeshd).");
}

/// Why a server without OpenCASCADE reads none.
inline tl::unexpected<Error> has_no_plugin() {
  return bad_option(
      "This server reads no CAD files, because it was installed without OpenCASCADE: libvarimesh_opencascade.so is "
      "neither beside the program nor named by VARIMESH_OPENCASCADE. Slide the nodes before you upload the mesh.");
}

/// Whether nodes slide on the mesh's own boundary, which needs no CAD model.
inline bool is_on_boundary(const v1::Geometry& geometry) {
  return geometry.slide_on() == v1::Geometry::SLIDE_ON_BOUNDARY;
}

/// How many surfaces a report lists at most, and for how many elements it has distances, so that it stays below two
/// megabytes.
inline constexpr std::size_t kMostSurfaces = 1000, kMostElementsMeasured = 100'000;

v1::GeometryReport to_proto(const SlidAndMeasured& done);
v1::SlideTrial to_proto(const SlideTrial& trial);

}  // namespace varimesh::server
