// Tells the service manager that started the server how it is.
#pragma once

#include <string>

namespace varimesh::server {

/// Sends lines such as "READY=1" to systemd (sd_notify(3)), if it listens: at the socket that the environment variable
/// NOTIFY_SOCKET names. Returns whether they were sent.
bool notify_manager(const std::string& lines);

}  // namespace varimesh::server
