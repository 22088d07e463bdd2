// The certificates of the server and of its clients, as OpenSSL takes them.
#pragma once

#include <openssl/ssl.h>

#include <memory>
#include <string>

#include "core/base/error.h"
#include "server/tls/tls.h"

namespace varimesh::server {

/// What new connections are encrypted with.
using TlsContext = std::shared_ptr<SSL_CTX>;

/// Reads the files, whose certificates clients must have if there is an authority. TLS 1.2 is the least, and a session
/// that goes on was begun with the same files. Errors: BadOption, with the flag of the file that cannot be used, and
/// the reason.
Expected<TlsContext> tls_context(const TlsFiles& files);

/// Whether the server's certificate is for this host, which is a name or an address of IP ("[::1]").
bool is_named(SSL_CTX& context, const std::string& host);

/// The common name in the certificate that the client has shown; empty if there is none.
std::string name_of_client(const SSL& connection);

}  // namespace varimesh::server
