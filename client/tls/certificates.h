// Certificates to try a server with TLS, or for a small group that needs no authority of others.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace varimesh::client {

/// Which certificates to make.
struct CertificateOrder {
  std::filesystem::path folder;
  std::vector<std::string> hosts;    ///< Names and IP addresses of the server.
  bool keep_server = false;          ///< The server keeps a certificate that the folder has.
  std::vector<std::string> clients;  ///< The common names of clients, each with a certificate of its own.
  int days = 365;                    ///< How long the certificates are valid. 0: they have already expired, for tests.
};

/// Makes an authority (authority.pem, authority-key.pem), unless the folder has one, and with it certificates for the
/// server (server.pem, server-key.pem) and the clients (NAME.pem, NAME-key.pem). Only the owner can read the keys. Each
/// file is replaced as a whole. Returns the names of the files. Errors: BadOption for a name that no file or
/// certificate can have, Output if a file cannot be written, BadInput if the authority of the folder cannot be used.
Expected<std::vector<std::string>> make_certificates(const CertificateOrder& order);

}  // namespace varimesh::client
