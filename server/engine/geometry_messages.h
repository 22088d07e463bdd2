// The geometry of a job: its options, and what came of it.
#pragma once

#include "core/base/error.h"
#include "core/options/options.h"
#include "core/slide/slide_on_file.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// Whether a job with these options can have this geometry. Errors: BadOption.
Expected<void> check(const v1::Geometry& geometry, const Options& options);

/// The options of the library for a geometry that passed check().
GeometryOptions geometry_options(const v1::Geometry& geometry, const Options& options);

v1::GeometryReport to_proto(const SlidOnGeometry& slid);

}  // namespace varimesh::server
