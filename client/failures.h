// gRPC statuses as the client's failures, and waiting for a server that is away.
#pragma once

#include <grpcpp/support/status.h>

#include <chrono>
#include <string>

#include "client/client.h"

namespace varimesh::client {

/// What a status that is not OK means to the caller.
Failure failure_of(const grpc::Status& status);

/// A local file that cannot be read or written.
tl::unexpected<Failure> file_failure(std::string sentence);

/// Repeats calls to a server that is unavailable, more and more slowly, until it has been away for too long, and calls
/// that it refuses for now when it wants to be asked again. Says when it goes away and when it is back
/// (Settings::on_contact).
class Patience {
 public:
  explicit Patience(const Settings& settings) : settings_(settings) {}

  /// Whether to call again after this status; waits a little if so, but not beyond an interrupt.
  bool again(const grpc::Status& status);
  /// The server was there: it may be away for the full time again.
  void reset();

 private:
  void say(bool answers);
  /// False where the caller wants to stop before that.
  bool sleep(std::chrono::milliseconds pause) const;

  const Settings& settings_;
  std::chrono::steady_clock::time_point away_since_{};
  std::chrono::steady_clock::time_point refused_since_{};
  std::chrono::milliseconds pause_{0};
  bool away_ = false;
};

}  // namespace varimesh::client
