// Options of an optimisation, of a geometry and of layers: between the library's structs and the messages of the
// contract, by the library's tables of options.
#pragma once

#include "core/options/geometry_options.h"
#include "core/options/layer_options.h"
#include "core/options/options.h"
#include "server/failure.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// An option that the message does not set has the library's default. Fails with INVALID_ARGUMENT for a value of an
/// enum that this server does not know. The library checks ranges.
Answer<Options> options_from(const v1::Options& message);
/// The same for a geometry. The digest is left out.
Answer<GeometryOptions> options_from(const v1::Geometry& message);
/// The same for layers.
Answer<LayerOptions> options_from(const v1::Layers& message);

/// The message with every field set, defaults included.
v1::Options to_proto(const Options& options);

}  // namespace varimesh::server
