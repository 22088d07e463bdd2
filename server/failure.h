// What a call to the service can end with, as a value that knows nothing of gRPC.
#pragma once

#include <map>
#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace varimesh::server {

/// Why something was not done. api/status.h turns it into a gRPC status with google.rpc.ErrorInfo.
struct Failure {
  enum class Code {
    InvalidArgument,
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
  std::string reason;    ///< For programs: MESH_NOT_FOUND; service.proto lists them.
  std::string sentence;  ///< For people: what was wrong, where, and what to do.
  std::map<std::string, std::string> metadata;
  int retry_seconds = 0;  ///< When it makes sense to ask again; 0: not said.
};

/// A value, or the reason why there is none.
template <class T>
using Answer = tl::expected<T, Failure>;

inline tl::unexpected<Failure> failure(Failure::Code code, std::string reason, std::string sentence,
                                       std::map<std::string, std::string> metadata = {}, int retry_seconds = 0) {
  return tl::unexpected<Failure>(
      Failure{code, std::move(reason), std::move(sentence), std::move(metadata), retry_seconds});
}

}  // namespace varimesh::server
