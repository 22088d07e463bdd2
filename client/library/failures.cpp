#include "client/library/failures.h"

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
  const bool is_away = status.error_code() == grpc::StatusCode::UNAVAILABLE ||
                       status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED ||
                       status.error_code() == grpc::StatusCode::UNIMPLEMENTED || failure.reason.empty();
  failure.kind = is_away ? Failure::Kind::Transport : Failure::Kind::Refused;
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE && failure.reason.empty())
    failure.sentence = "The server cannot be reached (" + failure.sentence + "); check that varimeshd runs there.";
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED)
    failure.sentence = "The server does not answer; check that varimeshd runs there and is not overloaded.";
  return failure;
}

tl::unexpected<Failure> file_failure(std::string sentence, std::string reason) {
  return tl::unexpected<Failure>(Failure{Failure::Kind::File, std::move(reason), std::move(sentence), {}});
}

tl::unexpected<Failure> refusal(std::string reason, std::string sentence) {
  return tl::unexpected<Failure>(Failure{Failure::Kind::Refused, std::move(reason), std::move(sentence), {}});
}

tl::unexpected<Failure> transport_failure(std::string sentence, std::string reason) {
  return tl::unexpected<Failure>(Failure{Failure::Kind::Transport, std::move(reason), std::move(sentence), {}});
}

tl::unexpected<Failure> interruption(std::string sentence) {
  return tl::unexpected<Failure>(Failure{Failure::Kind::Interrupted, "", std::move(sentence), {}});
}

}  // namespace varimesh::client
