// Failures as gRPC statuses with google.rpc.ErrorInfo and RetryInfo.
#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/support/status.h>

#include <exception>
#include <string>

#include "server/failure.h"

namespace varimesh::server {

/// The status of a failure; `detail`, where given, goes into its details.
grpc::Status status(const Failure& failure, const google::protobuf::Message* detail = nullptr);

/// What a call ends with whose peer has as many `things` ("watches") open as it may have.
grpc::Status peer_limit_status(const std::string& address, int most, const std::string& things);

/// What every stream ends with when the server stops.
grpc::Status stopping_status();

/// Runs `work` and turns whatever it throws into a status: nothing throws across a thread.
template <class Work>
grpc::Status guarded(Work&& work) {
  try {
    return work();
  } catch (const std::exception& error) {
    return status(Failure{Failure::Code::Internal,
                          "INTERNAL",
                          std::string("The server failed unexpectedly (") + error.what() + "); please report it.",
                          {},
                          0});
  }
}

}  // namespace varimesh::server
