// The server's log: spdlog on standard error.
#pragma once

#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// Sends the log, and the messages of gRPC, to standard error. `level` is the lowest level that is written: "trace",
/// "debug", "info", "warn", "error" or "off". Errors: BadOption for any other level.
Expected<void> start_log(const std::string& level);

}  // namespace varimesh::server
