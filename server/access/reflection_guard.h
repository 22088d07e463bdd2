// Keeps gRPC's reflection from callers who may not read.
#pragma once

#include <grpcpp/grpcpp.h>

#include "server/access/access.h"

namespace varimesh::server {

/// Reflection is a service of gRPC's own, so no handler of ours can ask who calls. Calls of callers who may not read
/// are cancelled before gRPC answers them. `access` must outlive the server.
void guard_reflection(grpc::ServerBuilder& builder, const Access& access);

}  // namespace varimesh::server
