// A mesh that is only a surface in space: its nodes slide in this process, and there is no job.
#pragma once

#include <vector>

#include "client/cli/common_flags.h"
#include "client/io/outputs.h"
#include "core/formats/formats.h"

namespace varimesh::client {

/// Writes the slid surface to the outputs, prints its quality with its certificates, and returns the exit status, which
/// is kInvalidLeft if an element is not certified valid.
/// @param asks_for_job  whether the user gave flags that only a job can serve; they are refused
int deliver_surface(const CommonFlags& flags, bool asks_for_job, const std::vector<Output>& outputs,
                    const formats::MeshFile& slid, int threads);

}  // namespace varimesh::client
