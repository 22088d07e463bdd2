#include "client/library/failures.h"

#include <gtest/gtest.h>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace varimesh::client {
namespace {

/// A status with google.rpc.ErrorInfo, as the server makes it.
grpc::Status status_with(grpc::StatusCode code, const std::string& sentence, const std::string& reason) {
  google::rpc::ErrorInfo info;
  info.set_reason(reason);
  (*info.mutable_metadata())["line"] = "7";
  google::rpc::Status full;
  full.set_code(code);
  full.set_message(sentence);
  full.add_details()->PackFrom(info);
  return {code, sentence, full.SerializeAsString()};
}

TEST(Failures, ARefusalHasTheReasonAndTheSentenceOfTheServer) {
  const Failure failure =
      failure_of(status_with(grpc::StatusCode::NOT_FOUND, "There is no such mesh.", "MESH_NOT_FOUND"));
  EXPECT_EQ(failure.kind, Failure::Kind::Refused);
  EXPECT_EQ(failure.reason, "MESH_NOT_FOUND");
  EXPECT_EQ(failure.sentence, "There is no such mesh.");
  EXPECT_EQ(failure.metadata.at("line"), "7");
}

TEST(Failures, AStatusWithoutAReasonIsAFailureOfTheTransport) {
  const Failure failure = failure_of({grpc::StatusCode::INTERNAL, "stream removed"});
  EXPECT_EQ(failure.kind, Failure::Kind::Transport);
  EXPECT_EQ(failure.sentence, "stream removed");
}

TEST(Failures, AnAbsentServerIsSaidToBeAbsent) {
  const Failure away = failure_of({grpc::StatusCode::UNAVAILABLE, "connection refused"});
  EXPECT_EQ(away.kind, Failure::Kind::Transport);
  EXPECT_NE(away.sentence.find("cannot be reached (connection refused)"), std::string::npos) << away.sentence;
  const Failure late = failure_of({grpc::StatusCode::DEADLINE_EXCEEDED, "Deadline Exceeded"});
  EXPECT_NE(late.sentence.find("does not answer"), std::string::npos) << late.sentence;
}

TEST(Failures, AServerThatIsStoppingKeepsItsOwnSentence) {
  const Failure failure = failure_of(status_with(grpc::StatusCode::UNAVAILABLE, "The server is stopping.", "STOPPING"));
  EXPECT_EQ(failure.kind, Failure::Kind::Transport);
  EXPECT_EQ(failure.sentence, "The server is stopping.");
}

}  // namespace
}  // namespace varimesh::client
