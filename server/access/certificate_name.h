// The name in the certificate of a caller.
#pragma once

#include <grpc/grpc_security_constants.h>
#include <grpcpp/grpcpp.h>

#include <string>

namespace varimesh::server {

/// Returns the common name in the certificate of the connection of a call; empty if there is none.
inline std::string name_in_certificate(const grpc::ServerContextBase& call) {
  const auto names = call.auth_context()->FindPropertyValues(GRPC_X509_CN_PROPERTY_NAME);
  return names.empty() ? std::string() : std::string(names.front().data(), names.front().size());
}

}  // namespace varimesh::server
