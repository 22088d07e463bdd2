// The tests of the webhooks of jobs that have ended.
#include "tests/server/jobs/job_store_conformance.h"

namespace varimesh::server::testing {
namespace {

using std::chrono::seconds;

TEST_P(Calls, AreDueWhenAJobHasEndedHoweverItEnded) {
  const std::string name = submit(with_webhook());
  const Claim running = claim();
  EXPECT_EQ(due(), "") << "it runs";
  Ending lost;
  lost.state = kPending;
  ASSERT_TRUE(store_->finish(running, lost, 0));
  EXPECT_EQ(due(), "") << "it waits again";
  ASSERT_TRUE(store_->finish(claim(), success(), 0));
  EXPECT_EQ(get(name).webhook_call().state(), v1::WebhookCall::STATE_WAITING);
  EXPECT_EQ(due(), name);
  const std::string cancelled = submit(with_webhook());
  ASSERT_TRUE(store_->request_cancel(cancelled, 0));
  EXPECT_EQ(due(), cancelled);
  const std::string failed = submit(with_webhook());
  Ending ending;
  ending.state = kFailed;
  ASSERT_TRUE(store_->finish(claim(), ending, 0));
  EXPECT_EQ(due(), failed);
  submit();
  ASSERT_TRUE(store_->finish(claim(), success(), 0));
  EXPECT_EQ(due(), "") << "it has no webhook";
  EXPECT_EQ(*store_->waiting_calls(), 3);
}

TEST_P(Calls, AreMadeByOneAtATimeAndAgainIfThatOneIsLost) {
  const std::string name = end_one();
  EXPECT_EQ(due(), name);
  EXPECT_EQ(due(), "") << "somebody calls";
  now_ += seconds(59);
  EXPECT_EQ(due(), "");
  now_ += seconds(1);
  EXPECT_EQ(due(), name) << "nobody has told of an outcome";
}

TEST_P(Calls, EndWhenTheyAreDelivered) {
  const std::string name = end_one();
  EXPECT_EQ(due(), name);
  ASSERT_TRUE(store_->note_call(name, {}));
  EXPECT_EQ(get(name).webhook_call().state(), v1::WebhookCall::STATE_DELIVERED);
  EXPECT_EQ(get(name).webhook_call().attempts(), 1);
  now_ += std::chrono::hours(100);
  EXPECT_EQ(due(), "");
  EXPECT_EQ(*store_->waiting_calls(), 0);
}

TEST_P(Calls, AreRepeatedWhenTheirPauseIsOverAndGivenUpInTheEnd) {
  const std::string name = end_one();
  EXPECT_EQ(due(), name);
  ASSERT_TRUE(store_->note_call(name, {"It hung.", seconds(5)}));
  EXPECT_EQ(get(name).webhook_call().state(), v1::WebhookCall::STATE_WAITING);
  EXPECT_EQ(get(name).webhook_call().error(), "It hung.");
  EXPECT_EQ(due(), "");
  now_ += seconds(5);
  EXPECT_EQ(due(), name);
  ASSERT_TRUE(store_->note_call(name, {"It hung.", seconds(1), false}));
  now_ += seconds(1);
  EXPECT_EQ(due(), name);
  ASSERT_TRUE(store_->note_call(name, {"It hung again."}));
  EXPECT_EQ(get(name).webhook_call().state(), v1::WebhookCall::STATE_GIVEN_UP);
  EXPECT_EQ(get(name).webhook_call().attempts(), 2) << "one was only put off";
  EXPECT_EQ(*store_->waiting_calls(), 0);
}

TEST_P(Calls, OfTheOldestEndComeFirstAndThoseOfDeletedJobsNever) {
  const std::string first = end_one();
  now_ += seconds(1);
  const std::string second = end_one(), third = end_one();
  ASSERT_TRUE(store_->remove(second));
  EXPECT_EQ(due(), first);
  EXPECT_EQ(due(), third);
  EXPECT_EQ(due(), "");
  ASSERT_TRUE(store_->remove(first));
  EXPECT_EQ(store_->note_call(first, {}).error().reason, "JOB_NOT_FOUND");
}

TEST_P(Calls, ThatHaveEndedStayAsTheyEnded) {
  const std::string name = end_one();
  EXPECT_EQ(due(), name);
  now_ += seconds(60);
  EXPECT_EQ(due(), name) << "the first one took too long";
  ASSERT_TRUE(store_->note_call(name, {}));
  ASSERT_TRUE(store_->note_call(name, {"It hung.", seconds(5)})) << "the first one";
  EXPECT_EQ(get(name).webhook_call().state(), v1::WebhookCall::STATE_DELIVERED);
  EXPECT_EQ(get(name).webhook_call().error(), "");
  EXPECT_EQ(get(name).webhook_call().attempts(), 1);
  now_ += seconds(5);
  EXPECT_EQ(due(), "");
}

TEST_P(Calls, KeepTheirJobsUntilTheyAreMade) {
  const std::string waiting = end_one(), delivered = end_one();
  ASSERT_EQ(due(), waiting);
  ASSERT_EQ(due(), delivered);
  ASSERT_TRUE(store_->note_call(delivered, {}));
  for (int newer = 0; newer < 2; ++newer) end_one();
  const auto beyond = [&] { return *store_->ended_beyond(2, now_ + seconds(1)); };
  EXPECT_EQ(beyond(), std::vector<std::string>{delivered});
  EXPECT_EQ(store_->ended_beyond(1, now_ + seconds(1))->size(), 2U) << "only as many again as are kept";
  EXPECT_EQ(store_->ended_beyond(0, now_ + seconds(1))->size(), 4U) << "too old in any case";
  ASSERT_TRUE(store_->note_call(waiting, {"It hung.", std::chrono::hours(1)}));
  EXPECT_EQ(beyond(), std::vector<std::string>{delivered}) << "it is made again";
  now_ += std::chrono::hours(24);
  EXPECT_EQ(beyond(), std::vector<std::string>{delivered}) << "it may still be";
  now_ += std::chrono::hours(1) + seconds(1);
  EXPECT_EQ(beyond(), (std::vector<std::string>{delivered, waiting})) << "nobody makes calls any longer";
}

TEST_P(DurableCalls, OutliveTheProcess) {
  const std::string name = end_one();
  reopen();
  EXPECT_EQ(due(), name) << "it ended before anybody was called";
  reopen();
  EXPECT_EQ(due(), "");
  now_ += seconds(60);
  EXPECT_EQ(due(), name) << "the process ended while it called";
  ASSERT_TRUE(store_->note_call(name, {"It hung.", seconds(5)}));
  reopen();
  now_ += seconds(5);
  EXPECT_EQ(due(), name);
  EXPECT_EQ(get(name).webhook_call().attempts(), 1);
}

}  // namespace
}  // namespace varimesh::server::testing
