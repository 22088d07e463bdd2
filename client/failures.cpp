// Reading of status details, and the pauses between attempts.
#include "client/failures.h"

#include <algorithm>
#include <thread>

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
  return failure;
}

tl::unexpected<Failure> file_failure(std::string sentence) {
  return tl::unexpected<Failure>(Failure{Failure::Kind::File, "", std::move(sentence), {}});
}

bool Patience::again(const grpc::Status& status) {
  if (status.error_code() != grpc::StatusCode::UNAVAILABLE || settings_.interrupted()) return false;
  const auto now = std::chrono::steady_clock::now();
  if (pause_.count() == 0) {
    away_since_ = now;
    pause_ = std::chrono::milliseconds(50);
  }
  if (now - away_since_ > settings_.retry) return false;
  std::this_thread::sleep_for(pause_);
  pause_ = std::min(pause_ * 2, std::chrono::milliseconds(2000));
  return true;
}

void Patience::reset() { pause_ = std::chrono::milliseconds(0); }

}  // namespace varimesh::client
