// Keeps gRPC's reflection from callers who may not read.
#pragma once

#include <grpcpp/grpcpp.h>
#include <grpcpp/support/server_interceptor.h>

#include <memory>

#include "server/access/access.h"

namespace varimesh::server {

using InterceptorFactory = std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>;

/// Reflection is a service of gRPC's own, so no handler of ours can ask who calls. Calls of callers who may not read
/// are cancelled before gRPC answers them. `access` must outlive the server.
InterceptorFactory reflection_guard(const Access& access);

}  // namespace varimesh::server
