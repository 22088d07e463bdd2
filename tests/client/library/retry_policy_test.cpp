#include "client/library/retry_policy.h"

#include <gtest/gtest.h>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace varimesh::client {
namespace {

using std::chrono::milliseconds;

const grpc::Status kAway(grpc::StatusCode::UNAVAILABLE, "connection refused");
const grpc::Status kRefused(grpc::StatusCode::INVALID_ARGUMENT, "no");

/// A refusal that asks for a repetition after `delay`.
grpc::Status refused_for(milliseconds delay) {
  google::rpc::RetryInfo retry;
  retry.mutable_retry_delay()->set_nanos(static_cast<int>(delay.count() * 1'000'000));
  google::rpc::Status full;
  full.set_code(grpc::StatusCode::RESOURCE_EXHAUSTED);
  full.add_details()->PackFrom(retry);
  return {grpc::StatusCode::RESOURCE_EXHAUSTED, "the queue is full", full.SerializeAsString()};
}

/// Settings that record what on_contact is told.
struct Recorded {
  std::vector<bool> contacts;
  Settings settings;

  explicit Recorded(milliseconds retry) {
    settings.retry = retry;
    settings.on_contact = [this](bool answers) { contacts.push_back(answers); };
  }
};

TEST(RetryPolicy, CallsToAnAbsentServerAreRepeatedUntilTheTimeIsOver) {
  Recorded recorded(milliseconds(600));
  RetryPolicy retries(recorded.settings);
  int attempts = 0;
  while (retries.wait_to_retry(kAway)) ++attempts;
  EXPECT_GE(attempts, 2);  // The pauses are 50, 100, 200 and 400 ms, or longer on a busy machine.
  EXPECT_LE(attempts, 4);
  EXPECT_EQ(recorded.contacts, std::vector<bool>{false});
}

TEST(RetryPolicy, AnAnswerIsToldAndAllowsTheFullTimeAgain) {
  Recorded recorded(milliseconds(80));
  RetryPolicy retries(recorded.settings);
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(retries.wait_to_retry(kAway)) << i;
    retries.server_answered();
  }
  EXPECT_EQ(recorded.contacts, (std::vector<bool>{false, true, false, true, false, true}));
}

TEST(RetryPolicy, ACallThatTheServerCutAtItsEndIsRepeated) {
  Recorded recorded(milliseconds(300));
  RetryPolicy retries(recorded.settings);
  EXPECT_TRUE(retries.wait_to_retry(grpc::Status(grpc::StatusCode::CANCELLED, "CANCELLED")));
  recorded.settings.interrupted = [] { return true; };
  EXPECT_FALSE(RetryPolicy(recorded.settings).wait_to_retry(grpc::Status(grpc::StatusCode::CANCELLED, "CANCELLED")))
      << "the user asked for it";
}

TEST(RetryPolicy, AServerThatSaysThatItStopsWasThere) {
  google::rpc::ErrorInfo info;
  info.set_reason("STOPPING");
  google::rpc::Status full;
  full.set_code(grpc::StatusCode::UNAVAILABLE);
  full.add_details()->PackFrom(info);
  const grpc::Status stops(grpc::StatusCode::UNAVAILABLE, "stops", full.SerializeAsString());
  Recorded recorded(milliseconds(100));
  RetryPolicy retries(recorded.settings);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(retries.wait_to_retry(stops)) << i << ": it is restarted again and again";
  while (retries.wait_to_retry(kAway)) {
  }
}

TEST(RetryPolicy, ARefusalIsFinal) {
  Recorded recorded(milliseconds(300));
  RetryPolicy retries(recorded.settings);
  EXPECT_FALSE(retries.wait_to_retry(kRefused));
  EXPECT_TRUE(recorded.contacts.empty());
}

TEST(RetryPolicy, ARefusalForNowIsRepeatedAfterTheDelayThatTheServerAsksFor) {
  Recorded recorded(milliseconds(300));
  RetryPolicy retries(recorded.settings);
  const auto start = std::chrono::steady_clock::now();
  EXPECT_TRUE(retries.wait_to_retry(refused_for(milliseconds(100))));
  EXPECT_GE(std::chrono::steady_clock::now() - start, milliseconds(100));
  EXPECT_FALSE(retries.wait_to_retry(refused_for(milliseconds(400))));
}

TEST(RetryPolicy, NothingIsRepeatedAfterAnInterrupt) {
  Settings settings;
  settings.interrupted = [] { return true; };
  RetryPolicy retries(settings);
  EXPECT_FALSE(retries.wait_to_retry(kAway));
}

TEST(RetryPolicy, AnInterruptEndsThePause) {
  Settings settings;
  int asked = 0;
  settings.interrupted = [&] { return ++asked > 1; };
  RetryPolicy retries(settings);
  const auto start = std::chrono::steady_clock::now();
  EXPECT_FALSE(retries.wait_to_retry(refused_for(milliseconds(900))));
  EXPECT_LT(std::chrono::steady_clock::now() - start, milliseconds(800));
}

}  // namespace
}  // namespace varimesh::client
