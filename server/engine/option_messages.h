// Options of an optimisation: between the library's struct and the message of the contract, by the library's table of
// options.
#pragma once

#include "core/options/options.h"
#include "server/failure.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::server {

/// An option that the message does not set has the library's default. Fails with INVALID_ARGUMENT for a value of an
/// enum that this server does not know. The library checks ranges.
Answer<Options> options_from(const v1::Options& message);

/// The message with every field set, defaults included.
v1::Options to_proto(const Options& options);

}  // namespace varimesh::server
