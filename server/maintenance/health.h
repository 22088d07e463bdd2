// Asks a server over its port for probes whether it is ready.
#pragma once

#include <chrono>
#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// Asks the server whose --metrics or --admin is `address` (HOST:PORT) for /healthz/ready. Returns whether it is ready.
/// Errors: BadOption if the address has no port, Output if nobody answers within `patience`.
Expected<bool> is_ready(const std::string& address, std::chrono::milliseconds patience);

}  // namespace varimesh::server
