// The server's log: spdlog on standard error.
#pragma once

#include <string>

#include "core/base/error.h"
#include "server/log/log_fields.h"

namespace varimesh::server {

/// Sends the log, and the messages of gRPC, to standard error. `level` is the lowest level that is written: "trace",
/// "debug", "info", "warn", "error" or "off". `format`: "text", or "json" for one object a line:
///
///   {"time", "level", "message", "job", "attempt", "owner", "address", "trace_id", "audit", "outcome"}
///
/// with the fields of the thread's LogScope, those that are empty left out. Errors: BadOption for any other level or
/// format.
Expected<void> start_log(const std::string& level, const std::string& format = "text");

/// Writes down what somebody did or may not do. `action`: "submit", "cancel", "delete", "delete mesh", or the method
/// that was refused. `subject`: the job or mesh. `outcome`: "ok", or the reason of the refusal. Who did it is in `who`.
void audit(const std::string& action, const std::string& subject, const std::string& outcome, const LogFields& who);

}  // namespace varimesh::server
