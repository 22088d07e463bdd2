// The server's log: spdlog on standard error.
#pragma once

#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// Sends the log to standard error from `level` on ("trace", "debug", "info", "warn", "error", "off"), and gRPC's own
/// messages into it. BadOption for a level that does not exist.
Expected<void> start_log(const std::string& level);

}  // namespace varimesh::server
