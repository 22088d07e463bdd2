// The iterations of a job as a CSV file.
#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// Writes one line per iteration, after a line with the names of the columns (OutputFile). Errors: Output.
Expected<void> write_history(const std::string& path, const std::vector<v1::Iteration>& history);

}  // namespace varimesh::client
