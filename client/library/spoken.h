// What a server speaks that no connection comes about with: TLS or plain HTTP/2.
#pragma once

#include <chrono>
#include <functional>
#include <string>

namespace varimesh::client {

enum class Spoken { Unknown, Tls, Plain };

/// Connects to HOST:PORT, sends the beginning of a TLS handshake and looks at what comes back. A server that speaks TLS
/// answers with a record of TLS; one that does not sends the settings of HTTP/2. Unknown if nothing can be heard within
/// `patience`, or if the address is that of a unix socket. Returns early if `interrupted` says so.
Spoken heard_from(const std::string& address, std::chrono::milliseconds patience,
                  const std::function<bool()>& interrupted = {});

}  // namespace varimesh::client
