// Converts failures to gRPC statuses with google.rpc.ErrorInfo and RetryInfo.
#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/support/status.h>

#include <exception>
#include <string>

#include "server/failure.h"
#include "server/refusals.h"

namespace varimesh::server {

/// Returns the gRPC status of a failure. If `detail` is given, it is added to the details of the status.
grpc::Status status(const Failure& failure, const google::protobuf::Message* detail = nullptr);
inline grpc::Status status(const Refusal& refusal, const google::protobuf::Message* detail = nullptr) {
  return status(refusal.value(), detail);
}

/// The status of every open stream when the server stops.
inline grpc::Status stopping_status() { return status(server_stopping(1)); }

/// Runs `work` and converts an exception to a status, since no exception may leave a thread.
template <class Work>
grpc::Status guarded(Work&& work) {
  try {
    return work();
  } catch (const std::exception& error) {
    return status(
        internal_failure(std::string("The server failed unexpectedly (") + error.what() + "); please report it."));
  }
}

}  // namespace varimesh::server
