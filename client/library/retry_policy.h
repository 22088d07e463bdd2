// Whether and when to repeat a call that failed.
#pragma once

#include <grpcpp/support/status.h>

#include <chrono>

#include "client/client.h"

namespace varimesh::client {

/// Decides about the repetition of one call, or of a sequence of calls for one purpose.
///
/// A call to a server that is unavailable is repeated after pauses that double from 50 ms to 2 s, until the server has
/// been away for Settings::retry. A call that the server refuses for now is repeated after the delay that the server
/// asks for, until Settings::retry has passed since the first refusal. Settings::on_contact is told when the server
/// goes away and when it is back.
class RetryPolicy {
 public:
  explicit RetryPolicy(const Settings& settings) : settings_(settings) {}

  /// Whether to repeat the call that ended with `status`. If so, it first sleeps for the pause. Returns false at once
  /// if the caller wants to stop.
  bool wait_to_retry(const grpc::Status& status);
  /// The server has answered, so from now on it may be away for the full time again.
  void server_answered();

 private:
  bool wait_for_busy_server(std::chrono::milliseconds delay);
  bool wait_for_absent_server(bool was_there);
  void tell_contact(bool answers);
  /// Returns false if the caller wants to stop before the pause is over.
  bool sleep(std::chrono::milliseconds pause) const;

  const Settings& settings_;
  std::chrono::steady_clock::time_point away_since_{};
  std::chrono::steady_clock::time_point refused_since_{};
  std::chrono::milliseconds pause_{0};  ///< The last pause for an absent server; 0: the server was there.
  bool away_ = false;
};

}  // namespace varimesh::client
