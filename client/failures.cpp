// Reading of status details, and the pauses between attempts.
#include "client/failures.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace varimesh::client {

Failure failure_of(const grpc::Status& status) {
  Failure failure;
  failure.sentence = status.error_message();
  google::rpc::Status full;
  if (full.ParseFromString(status.error_details())) {
    for (const auto& detail : full.details()) {
      google::rpc::ErrorInfo info;
      if (!detail.UnpackTo(&info)) continue;
      failure.reason = info.reason();
      failure.metadata.insert(info.metadata().begin(), info.metadata().end());
    }
  }
  const bool away = status.error_code() == grpc::StatusCode::UNAVAILABLE ||
                    status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED ||
                    status.error_code() == grpc::StatusCode::UNIMPLEMENTED || failure.reason.empty();
  failure.kind = away ? Failure::Kind::Transport : Failure::Kind::Refused;
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE && failure.reason.empty())
    failure.sentence = "The server cannot be reached (" + failure.sentence + "); see that varimeshd runs there.";
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED)
    failure.sentence = "The server does not answer; see that varimeshd runs there and is not overloaded.";
  return failure;
}

tl::unexpected<Failure> file_failure(std::string sentence) {
  return tl::unexpected<Failure>(Failure{Failure::Kind::File, "", std::move(sentence), {}});
}

namespace {

/// When the server wants to be asked again; 0: it does not say.
std::chrono::milliseconds retry_delay(const grpc::Status& status) {
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

bool Patience::sleep(std::chrono::milliseconds pause) const {
  const auto end = std::chrono::steady_clock::now() + pause;
  while (std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    if (settings_.wants_to_stop()) return false;
  }
  return true;
}

bool Patience::again(const grpc::Status& status) {
  using Clock = std::chrono::steady_clock;
  if (settings_.wants_to_stop()) return false;
  if (const auto delay = retry_delay(status); delay.count() > 0) {
    say(true);
    const auto now = Clock::now();
    if (refused_since_ == Clock::time_point{}) refused_since_ = now;
    return now + delay - refused_since_ <= settings_.retry && sleep(delay);
  }
  if (status.error_code() != grpc::StatusCode::UNAVAILABLE) {
    // A no is an answer too; these two are made on this side.
    if (status.error_code() != grpc::StatusCode::CANCELLED &&
        status.error_code() != grpc::StatusCode::DEADLINE_EXCEEDED)
      say(true);
    return false;
  }
  const auto now = Clock::now();
  if (pause_.count() == 0) {
    away_since_ = now;
    pause_ = std::chrono::milliseconds(50);
  }
  if (now - away_since_ > settings_.retry) return false;
  say(false);
  if (!sleep(pause_)) return false;
  pause_ = std::min(pause_ * 2, std::chrono::milliseconds(2000));
  return true;
}

void Patience::reset() {
  pause_ = std::chrono::milliseconds(0);
  refused_since_ = {};
  say(true);
}

void Patience::say(bool answers) {
  if (std::exchange(away_, !answers) == !answers) return;
  if (settings_.on_contact) settings_.on_contact(answers);
}

}  // namespace varimesh::client
