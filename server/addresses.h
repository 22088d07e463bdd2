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

/// How a server knows its callers, and whether it encrypts.
struct Protection {
  bool tls = false;       ///< The server has a certificate.
  bool mutual = false;    ///< Clients need certificates.
  bool tokens = false;    ///< Callers need tokens.
  bool insecure = false;  ///< The user allows every address.
};

/// Checks an address that the server is to listen on. Beyond loopback it needs TLS, and certificates or tokens of its
/// callers. Errors: BadOption if the address has no port from 0 to 65535, if it may not be listened on, or if it is a
/// unix socket with TLS.
Expected<void> check_listen_address(const std::string& address, const Protection& protection);

/// The same for an address that is to be encrypted whatever it is.
Expected<void> check_https_address(const std::string& address, const Protection& protection);

/// Returns the address of a caller without its port, from gRPC's "ipv4:10.0.0.7:50312" or "ipv6:%5B::1%5D:50312";
/// "unix" for a socket.
std::string peer_address(const std::string& peer);

}  // namespace varimesh::server
