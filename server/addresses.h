// Addresses: those that the server listens on, and those of its callers.
#pragma once

#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// Returns whether only this machine can reach an address: 127.0.0.0/8, ::1, localhost, or a unix socket.
/// `address`: HOST:PORT, [HOST]:PORT or unix:PATH.
bool is_loopback(const std::string& address);

/// Returns whether the address is a unix socket: unix:PATH.
bool is_unix_socket(const std::string& address);

/// Checks an address that the server is to listen on. `insecure`: the user allows addresses beyond loopback.
/// Errors: BadOption if the address has no port from 0 to 65535, or if it is not loopback and `insecure` is false.
Expected<void> check_listen_address(const std::string& address, bool insecure);

/// Returns the address of a caller without its port, from gRPC's "ipv4:10.0.0.7:50312" or "ipv6:%5B::1%5D:50312";
/// "unix" for a socket.
std::string peer_address(const std::string& peer);

}  // namespace varimesh::server
