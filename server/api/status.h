// Failures as gRPC statuses with google.rpc.ErrorInfo and RetryInfo.
#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/support/status.h>

#include "server/failure.h"

namespace varimesh::server {

/// The status of a failure; `detail`, where given, goes into its details.
grpc::Status status(const Failure& failure, const google::protobuf::Message* detail = nullptr);

/// What every stream ends with when the server stops.
grpc::Status stopping_status();

}  // namespace varimesh::server
