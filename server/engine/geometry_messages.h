// The geometry of a job: its options, and what came of it.
#pragma once

#include "core/base/error.h"
#include "core/options/options.h"
#include "core/slide/distance/slide_and_measure.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// Whether a job with these options can have this geometry. Errors: BadOption.
Expected<void> check(const v1::Geometry& geometry, const Options& options);

/// The options of the library for a geometry that passed check().
GeometryOptions geometry_options(const v1::Geometry& geometry, const Options& options);

/// How many surfaces a report lists at most, and for how many elements it has distances, so that it stays below two
/// megabytes.
inline constexpr std::size_t kMostSurfaces = 1000, kMostElementsMeasured = 100'000;

v1::GeometryReport to_proto(const SlidAndMeasured& done);

}  // namespace varimesh::server
