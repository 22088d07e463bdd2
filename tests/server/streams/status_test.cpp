// Failures as gRPC statuses, and the refusals that they come from.
#include "server/streams/status.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace varimesh::server {
namespace {

/// The details of a status.
struct Details {
  explicit Details(const grpc::Status& status) {
    google::rpc::Status full;
    EXPECT_TRUE(full.ParseFromString(status.error_details()));
    EXPECT_EQ(full.message(), status.error_message());
    EXPECT_EQ(full.code(), status.error_code());
    for (const auto& detail : full.details()) {
      detail.UnpackTo(&info);
      has_retry = detail.UnpackTo(&retry) || has_retry;
    }
  }
  google::rpc::ErrorInfo info;
  google::rpc::RetryInfo retry;
  bool has_retry = false;
};

TEST(Status, HasTheReasonTheMetadataAndARetryTime) {
  const grpc::Status refused = status(peer_limit("10.0.0.7", 3, "open watches"));
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(refused.error_message().find("10.0.0.7 already has 3 open watches"), std::string::npos);
  const Details details(refused);
  EXPECT_EQ(details.info.reason(), "PEER_LIMIT");
  EXPECT_EQ(details.info.domain(), "varimesh");
  EXPECT_EQ(details.info.metadata().at("peer"), "10.0.0.7");
  EXPECT_EQ(details.retry.retry_delay().seconds(), 5);
}

TEST(Status, HasNoRetryTimeIfTryingAgainIsUseless) {
  EXPECT_FALSE(Details(status(job_not_found("jobs/none"))).has_retry);
}

TEST(Status, HasTheCodeOfEachRefusal) {
  using grpc::StatusCode;
  EXPECT_EQ(status(bad_request("Wrong.")).error_code(), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status(mesh_not_found("digest")).error_code(), StatusCode::NOT_FOUND);
  EXPECT_EQ(status(mesh_missing("digest")).error_code(), StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(status(upload_id_used("id")).error_code(), StatusCode::ALREADY_EXISTS);
  EXPECT_EQ(status(claim_lost("jobs/1")).error_code(), StatusCode::ABORTED);
  EXPECT_EQ(status(chunk_out_of_order(3, 0)).error_code(), StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(status(store_full("Full")).error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status(data_lost("Lost.")).error_code(), StatusCode::DATA_LOSS);
  EXPECT_EQ(status(server_stopping(1)).error_code(), StatusCode::UNAVAILABLE);
  EXPECT_EQ(status(internal_failure("Failed.")).error_code(), StatusCode::INTERNAL);
}

TEST(Status, ReportsAnException) {
  const grpc::Status failed = guarded([]() -> grpc::Status { throw std::runtime_error("out of luck"); });
  EXPECT_EQ(failed.error_code(), grpc::StatusCode::INTERNAL);
  EXPECT_NE(failed.error_message().find("out of luck"), std::string::npos);
}

TEST(Status, HasOneLineOfAtMostAKibibyte) {
  const std::string name = "\x1b]0;owned\a\n" + std::string(5'000'000, 'n') + "\xff";
  const grpc::Status refused = status(job_not_found(name));
  EXPECT_LE(refused.error_message().size(), 1024u);
  EXPECT_LE(refused.error_details().size(), 2048u) << "gRPC sends them in a header, which clients limit to 8 KiB";
  for (const char c : refused.error_message()) EXPECT_GE(static_cast<unsigned char>(c), 0x20);
  EXPECT_NE(refused.error_message().find("list the jobs to see their names"), std::string::npos);
  EXPECT_EQ(Details(refused).info.metadata().at("job").find('\n'), std::string::npos);
}

}  // namespace
}  // namespace varimesh::server
