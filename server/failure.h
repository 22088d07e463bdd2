// Why a call to the service fails, as a value. Nothing here depends on gRPC.
#pragma once

#include <map>
#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace varimesh::server {

/// The reason why the server did not do something. streams/status.h turns it into a gRPC status with
/// google.rpc.ErrorInfo.
struct Failure {
  enum class Code {
    InvalidArgument,
    Unauthenticated,
    PermissionDenied,
    NotFound,
    AlreadyExists,
    FailedPrecondition,
    OutOfRange,
    ResourceExhausted,
    Aborted,
    DataLoss,
    Unavailable,
    Internal,
  };
  Code code = Code::Internal;
  std::string reason;    ///< For programs, such as MESH_NOT_FOUND. service.proto lists the reasons.
  std::string sentence;  ///< For people: what was wrong, where, and what to do.
  std::map<std::string, std::string> metadata;
  int retry_seconds = 0;  ///< When the caller may try again, in seconds. 0: not stated.
};

/// A value, or the reason why there is none.
template <class T>
using Answer = tl::expected<T, Failure>;

/// A failure as a function with an Answer returns it. refusals.h has one function for each kind.
using Refusal = tl::unexpected<Failure>;

}  // namespace varimesh::server
