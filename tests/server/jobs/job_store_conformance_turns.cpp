// Who is next, and what is kept of each owner, in every job store.
#include <algorithm>

#include "tests/server/jobs/job_store_conformance.h"

namespace varimesh::server::testing {
namespace {

TEST_P(FairTurns, GoToWhoHasTheLeastAndWaitedLongest) {
  const auto next = [&] { return (*store_->claim("worker"))->claim; };
  const std::string ann = submit_as("ann"), again = submit_as("ann"), bob = submit_as("bob");
  const Claim first = next();
  EXPECT_EQ(first.name, ann) << "among equals the first name";
  ASSERT_TRUE(store_->finish(first, success(), 0));
  const Claim second = next();
  EXPECT_EQ(second.name, bob) << "ann has had a turn";
  submit_as("bob");
  EXPECT_EQ(next().name, again) << "bob has a job that runs";
  const std::string eve = submit_as("eve");
  ASSERT_TRUE(store_->finish(second, success(), 0));
  EXPECT_EQ(next().name, eve) << "who is new has had no turn";
}

TEST_P(FairTurns, NobodyWaitsForAllJobsOfSomebodyElse) {
  for (int i = 0; i < 500; ++i) submit_as("flood", 100);
  const std::string first = submit_as("ann", -100), second = submit_as("ann", -100), bobs = submit_as("bob");
  std::vector<std::string> order;
  for (int i = 0; i < 6; ++i) order.push_back(run_next());
  EXPECT_EQ(std::ranges::count_if(order, [](const std::string& name) { return name.starts_with("jobs/flood"); }), 3);
  for (const std::string& name : {first, second, bobs}) EXPECT_NE(std::ranges::find(order, name), order.end()) << name;
  EXPECT_TRUE(run_next().starts_with("jobs/flood")) << "who is left has all turns";
}

TEST_P(FairTurns, PrioritiesOrderTheJobsOfOnePeer) {
  const std::string low = submit_as("ann", -5), normal = submit_as("ann"), high = submit_as("ann", 5);
  const std::string of_bob = submit_as("bob");
  std::vector<std::string> order;
  for (int i = 0; i < 4; ++i) order.push_back(run_next());
  EXPECT_EQ(order, (std::vector<std::string>{high, of_bob, normal, low}));
}

TEST_P(FairTurns, RunningJobsCountAsTurns) {
  for (const char* peer : {"ann", "ann", "ann", "bob"}) submit_as(peer);
  EXPECT_TRUE(claim().name.starts_with("jobs/ann"));
  EXPECT_TRUE(claim().name.starts_with("jobs/bob"));
  EXPECT_TRUE(claim().name.starts_with("jobs/ann"));
  submit_as("bob");
  EXPECT_TRUE(claim().name.starts_with("jobs/bob")) << "one of Bob's jobs runs, and two of Ann's";
}

TEST_P(FairTurns, JobsThatNeedADeviceAreLeftToWhoHasOne) {
  const std::string first = submit_as("ann", 0, true), later = submit_as("ann"), of_bob = submit_as("bob", 0, true);
  const auto next = [&](bool has_device) {
    const auto claimed = *store_->claim("worker", {.needs_no_device = !has_device});
    return claimed ? claimed->claim : Claim();
  };
  EXPECT_EQ(next(false).name, later) << "whatever waits before it";
  EXPECT_EQ(next(false).name, "");
  const Claim lost = next(true);
  EXPECT_EQ(lost.name, of_bob) << "ann has a job that runs";
  EXPECT_EQ(next(true).name, first);
  EXPECT_EQ(next(true).name, "");
  Ending given_back;
  given_back.state = v1::JOB_STATE_PENDING;
  ASSERT_TRUE(store_->finish(lost, given_back, 0));
  EXPECT_EQ(next(false).name, "") << "it needs one as before";
  EXPECT_EQ(next(true).name, of_bob);
}

TEST_P(FairTurns, NobodyFillsTheQueueForOthers) {
  const auto reason_of = [&](const std::string& peer) {
    const auto submitted = store_->submit({"", spec(), "jobs/" + std::to_string(++names_), 3, peer, 0, peer});
    return submitted ? "accepted" : submitted.error().reason;
  };
  for (int i = 0; i < 3; ++i) EXPECT_EQ(reason_of("flood"), "accepted");
  EXPECT_EQ(reason_of("flood"), "QUEUE_FULL");
  for (const char* peer : {"ann", "bob", "carl"}) {
    EXPECT_EQ(reason_of(peer), "accepted") << peer;
    EXPECT_EQ(reason_of(peer), "QUEUE_FULL") << peer;
  }
  EXPECT_EQ(reason_of("dora"), "QUEUE_FULL") << "twice as many as may wait";
}

TEST_P(FairTurns, KeepsTheEndedJobsOfEachOwner) {
  const std::string kept = submit_as("ann");
  EXPECT_EQ(run_next(), kept);
  std::vector<std::string> of_flood;
  for (int i = 0; i < 20; ++i) {
    submit_as("flood");
    of_flood.push_back(run_next());
  }
  now_ += std::chrono::hours(1);
  auto beyond = *store_->ended_beyond(5, now_);
  std::ranges::sort(beyond);
  std::vector<std::string> oldest(of_flood.begin(), of_flood.end() - 5);
  std::ranges::sort(oldest);
  EXPECT_EQ(beyond, oldest) << "the jobs of one owner never push out those of another";
  EXPECT_EQ(store_->ended_beyond(0, now_)->size(), 21u);
}

}  // namespace
}  // namespace varimesh::server::testing
