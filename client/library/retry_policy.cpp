#include "client/library/retry_policy.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "client/library/failures.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace varimesh::client {
namespace {

using Clock = std::chrono::steady_clock;

/// The delay that a server which refuses a call for now asks for; 0 if it does not ask for one.
std::chrono::milliseconds requested_delay(const grpc::Status& status) {
  google::rpc::Status full;
  google::rpc::RetryInfo retry;
  if (status.error_code() != grpc::StatusCode::RESOURCE_EXHAUSTED || !full.ParseFromString(status.error_details()))
    return {};
  for (const auto& detail : full.details())
    if (detail.UnpackTo(&retry))
      return std::chrono::seconds(retry.retry_delay().seconds()) +
             std::chrono::milliseconds(retry.retry_delay().nanos() / 1'000'000);
  return {};
}

}  // namespace

bool RetryPolicy::sleep(std::chrono::milliseconds pause) const {
  const auto end = Clock::now() + pause;
  while (Clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    if (settings_.wants_to_stop()) return false;
  }
  return true;
}

bool RetryPolicy::wait_to_retry(const grpc::Status& status) {
  if (settings_.wants_to_stop()) return false;
  if (const auto delay = requested_delay(status); delay.count() > 0) return wait_for_busy_server(delay);
  // CANCELLED, although nobody here asked for it: the call came at the moment when the server shut down.
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE || status.error_code() == grpc::StatusCode::CANCELLED)
    return wait_for_absent_server(failure_of(status).reason == "STOPPING");
  // Any other status is an answer of the server, except for this one, which this side makes itself.
  if (status.error_code() != grpc::StatusCode::DEADLINE_EXCEEDED) tell_contact(true);
  return false;
}

bool RetryPolicy::wait_for_busy_server(std::chrono::milliseconds delay) {
  tell_contact(true);
  const auto now = Clock::now();
  if (refused_since_ == Clock::time_point{}) refused_since_ = now;
  return now + delay - refused_since_ <= settings_.retry && sleep(delay);
}

bool RetryPolicy::wait_for_absent_server(bool was_there) {
  const auto now = Clock::now();
  // A server that says that it stops was there a moment ago, however often that happens.
  if (pause_.count() == 0 || was_there) away_since_ = now;
  pause_ = std::max(pause_, std::chrono::milliseconds(50));
  if (now - away_since_ > settings_.retry) return false;
  tell_contact(false);
  if (!sleep(pause_)) return false;
  pause_ = std::min(pause_ * 2, std::chrono::milliseconds(2000));
  return true;
}

void RetryPolicy::server_answered() {
  pause_ = std::chrono::milliseconds(0);
  refused_since_ = {};
  tell_contact(true);
}

void RetryPolicy::tell_contact(bool answers) {
  const bool was_away = std::exchange(away_, !answers);
  if (was_away == away_) return;
  if (settings_.on_contact) settings_.on_contact(answers);
}

}  // namespace varimesh::client
