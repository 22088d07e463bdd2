// TLS: the certificates of the server and of its clients.
#pragma once

#include <grpcpp/security/server_credentials.h>

#include <chrono>
#include <memory>
#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// The files of a server that encrypts, in PEM. All empty: it does not.
struct TlsFiles {
  std::string certificate;  ///< The server's certificate, and then the certificates between it and its authority.
  std::string key;          ///< The private key of the certificate.
  std::string authority;    ///< Whose certificates clients must have (mutual TLS). Empty: clients need none.

  bool are_given() const { return !certificate.empty() || !key.empty() || !authority.empty(); }
  /// Whether clients must have certificates.
  bool are_mutual() const { return !authority.empty(); }
};

/// Checks that the files belong together and can be used now. Errors: BadOption, with the file and the reason.
/// `copies`: what has their bytes, if these are not the files themselves; who may write or read the files counts.
Expected<void> check_tls_files(const TlsFiles& files, const TlsFiles* copies = nullptr);

/// Returns credentials that read the files again when they change: new connections see the new certificates, open ones
/// go on. TLS 1.2 is the least. Without files nothing is encrypted. The files must be good whenever they are read
/// (last_good_files.h).
std::shared_ptr<grpc::ServerCredentials> server_credentials(const TlsFiles& files);

/// Whether something at HOST:PORT begins to speak TLS within the patience. No certificate is checked or shown.
bool speaks_tls(const std::string& address, std::chrono::milliseconds patience);

}  // namespace varimesh::server
