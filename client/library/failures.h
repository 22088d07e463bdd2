// The ways in which a call can fail, and the failure that a gRPC status stands for.
#pragma once

#include <grpcpp/support/status.h>

#include <string>
#include <tl/expected.hpp>

#include "client/client.h"

namespace varimesh::client {

/// The failure that a status other than OK means.
Failure failure_of(const grpc::Status& status);

/// A local file cannot be read or written. The reason is empty, BAD_INPUT or OUTPUT.
tl::unexpected<Failure> file_failure(std::string sentence, std::string reason = {});
/// The request makes no sense to the server; `reason` is one of those that service.proto lists.
tl::unexpected<Failure> refusal(std::string reason, std::string sentence);
/// The server cannot be reached, or what it sent is damaged.
tl::unexpected<Failure> transport_failure(std::string sentence, std::string reason = {});
/// The caller asked to stop.
tl::unexpected<Failure> interruption(std::string sentence);

}  // namespace varimesh::client
