// Other ways to slide that a job tries, in words.
#pragma once

#include <string>

#include "varimesh/v1/job.pb.h"

namespace varimesh::client {

/// What begins, or what came of it, in a sentence or two; empty if there is nothing to say.
/// @param geometry  of the job
std::string trial_text(const v1::SlideTrial& trial, const v1::Geometry& geometry);

}  // namespace varimesh::client
