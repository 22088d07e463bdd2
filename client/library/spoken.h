// What a server speaks that no connection comes about with: TLS or plain HTTP/2, or whether nobody listens at all.
#pragma once

#include <chrono>
#include <functional>
#include <string>

namespace varimesh::client {

enum class Spoken { Unknown, Tls, Plain, Refused };

/// Connects to HOST:PORT, sends the beginning of a TLS handshake and looks at what comes back. A server that speaks TLS
/// answers with a record of TLS; one that does not sends the settings of HTTP/2. Refused if the host is there, but
/// nobody listens at the port, or at the path of a unix socket. Unknown if nothing can be heard within `patience`, or
/// if somebody listens at a unix socket. Returns early if `interrupted` says so.
Spoken heard_from(const std::string& address, std::chrono::milliseconds patience,
                  const std::function<bool()>& interrupted = {});

}  // namespace varimesh::client
