// The tests of checkpoints, cancelling, the end of jobs, and stores that outlive the process.
#include <set>

#include "tests/server/jobs/job_store_conformance.h"

namespace varimesh::server::testing {
namespace {

// ===== checkpoints =====

TEST_P(JobStoreConformance, GivesTheNewestCheckpointToTheNextAttempt) {
  submit();
  const Claim first = claim();
  EXPECT_FALSE(first.checkpoint);
  EXPECT_TRUE(store_->note_checkpoint(first, {"old", 10})->released.empty());
  EXPECT_EQ(store_->note_checkpoint(first, {"new", 20})->released, std::vector<std::string>{"old"});
  store_->take_back("worker", {});
  const Claim second = claim();
  ASSERT_TRUE(second.checkpoint);
  EXPECT_EQ(second.checkpoint->digest, "new");
  EXPECT_EQ(second.checkpoint->iteration, 20);
  std::multiset<std::string> digests;
  const auto references = store_->references();
  for (const Reference& reference : *references) digests.insert(reference.digest);
  EXPECT_EQ(digests, (std::multiset<std::string>{"mesh", "new"}));
  submit(spec("waiting"));
  EXPECT_EQ(*store_->needed_digests(), (std::set<std::string>{"mesh", "new", "waiting"}));
  EXPECT_EQ(store_->finish(second, success(), 0)->released, std::vector<std::string>{"new"});
  EXPECT_EQ(*store_->needed_digests(), std::set<std::string>{"waiting"}) << "the other job has ended";
}

TEST_P(JobStoreConformance, TellsWhichDigestsJobsReferTo) {
  const auto digest = [](char letter) { return std::string(64, letter); };
  const std::set<std::string> all{digest('a'), digest('b'), digest('c'), digest('d'), digest('e'), digest('f')};
  const auto needed = [&] {
    std::string letters;
    const auto referenced = store_->referenced(all);
    for (const std::string& one : *referenced) letters += one[0];
    return letters;
  };
  const std::string name = submit(spec(digest('a')));
  EXPECT_EQ(needed(), "a");
  const Claim first = claim();
  ASSERT_TRUE(store_->note_checkpoint(first, {digest('b'), 10}));
  EXPECT_EQ(needed(), "ab");
  ASSERT_TRUE(store_->note_checkpoint(first, {digest('c'), 20}));
  EXPECT_EQ(needed(), "ac");
  Ending ending = success();
  for (const char letter : {'a', 'd'}) {
    v1::StoredMesh& result = ending.results.emplace_back();
    result.set_digest(digest(letter));
    result.set_size('0');  // its bytes look like a digit
  }
  ending.history_digest = digest('e');
  ASSERT_TRUE(store_->finish(first, ending, 0));
  EXPECT_EQ(needed(), "ade");
  ASSERT_TRUE(store_->remove(name));
  EXPECT_EQ(needed(), "");
}

TEST_P(JobStoreConformance, TellsThatAJobRefersToItsGeometryUntilItIsDeleted) {
  const std::string mesh(64, 'a'), geometry(64, 'c');
  v1::JobSpec with_geometry = spec(mesh);
  (*with_geometry.mutable_labels())["run"] = "17";
  with_geometry.mutable_geometry()->set_digest(geometry);
  const std::string name = submit(with_geometry);
  const std::set<std::string> both{mesh, geometry};
  EXPECT_EQ(*store_->referenced(both), both);
  EXPECT_EQ(*store_->needed_digests(), both);
  const Claim running = claim();
  ASSERT_TRUE(store_->note_checkpoint(running, {std::string(64, 'b'), 10}));
  EXPECT_EQ(*store_->referenced(both), both) << "while it runs";
  ASSERT_TRUE(store_->finish(running, success(), 0));
  EXPECT_EQ(*store_->referenced(both), both) << "as long as somebody may ask what the job was";
  ASSERT_TRUE(store_->remove(name));
  EXPECT_EQ(*store_->referenced(both), std::set<std::string>());
}

TEST_P(JobStoreConformance, DoesNotCountALossAfterANewCheckpoint) {
  const std::string name = submit();
  for (int attempt = 1; attempt <= 6; ++attempt) {
    ASSERT_TRUE(store_->note_checkpoint(claim(), {"at " + std::to_string(attempt), attempt}));
    EXPECT_EQ(store_->take_back("worker", {})->front().job.state(), kPending);
  }
  for (int attempt = 1; attempt <= 2; ++attempt) {
    ASSERT_TRUE(store_->note_checkpoint(claim(), {"still there", 6}));
    EXPECT_EQ(store_->take_back("worker", {})->front().job.state(), attempt == 1 ? kPending : kFailed);
  }
  EXPECT_EQ(get(name).error().reason(), "LOST");
}

TEST_P(JobStoreConformance, DoesNotCountALossAfterProgress) {
  const std::string name = submit();
  v1::Iteration iteration;
  // The first attempt is lost too, but it has made progress.
  for (int attempt = 1; attempt <= 6; ++attempt) {
    const Claim claimed = claim();
    iteration.set_number(attempt);
    ASSERT_TRUE(store_->note_progress(claimed, iteration, 0));
    EXPECT_EQ(store_->take_back("worker", {})->front().job.state(), kPending);
  }
  for (int attempt = 1; attempt <= 2; ++attempt) {
    const Claim claimed = claim();
    for (const int number : {1, 6}) {
      iteration.set_number(number);
      ASSERT_TRUE(store_->note_progress(claimed, iteration, 0));
    }
    EXPECT_EQ(store_->take_back("worker", {})->front().job.state(), attempt == 1 ? kPending : kFailed);
  }
  EXPECT_EQ(get(name).error().reason(), "LOST");
}

TEST_P(JobStoreConformance, TriesAJobAgainWhoseProcessEndedAndThenGivesUp) {
  const std::string name = submit();
  Ending lost;
  lost.state = kPending;
  lost.lost = "crashed (signal 11)";
  for (int attempt = 1; attempt <= 2; ++attempt) {
    EXPECT_EQ(store_->finish(claim(), lost, 0)->job.state(), kPending);
    EXPECT_FALSE(get(name).has_error());
  }
  const Claim last = claim();
  EXPECT_EQ(last.attempt, 3);
  EXPECT_EQ(store_->finish(last, lost, 0)->job.state(), kFailed);
  EXPECT_EQ(get(name).error().reason(), "LOST");
  EXPECT_NE(get(name).error().message().find("crashed (signal 11), 3 times"), std::string::npos);
  EXPECT_EQ(store_->events(name)->back().state_change().error().reason(), "LOST");

  const std::string cancelled = submit();
  const Claim claimed = claim();
  store_->request_cancel(cancelled, 0);
  EXPECT_EQ(store_->finish(claimed, lost, 0)->job.state(), kCancelled);
}

// ===== cancelling, ending, forgetting =====

TEST_P(JobStoreConformance, CancelsWaitingJobsAtOnceAndTellsTheWorkersOfRunningOnes) {
  const std::string running = submit(), waiting = submit();
  const Claim claimed = claim();
  EXPECT_FALSE(*store_->renew_lease(claimed));
  EXPECT_EQ(store_->request_cancel(waiting, 0)->job.state(), kCancelled);
  EXPECT_EQ(store_->request_cancel(running, 0)->job.state(), kCancelling);
  EXPECT_TRUE(store_->request_cancel(running, 0)->events.empty()) << "it was already cancelled";
  EXPECT_TRUE(*store_->renew_lease(claimed));
  EXPECT_FALSE(*store_->claim("worker"));
  Ending ending = success();
  ending.state = kCancelled;
  ASSERT_TRUE(store_->finish(claimed, ending, 0));
  EXPECT_EQ(get(running).state(), kCancelled);
  EXPECT_EQ(get(running).results_size(), 1) << "the best mesh so far";
  EXPECT_TRUE(store_->request_cancel(running, 0)->events.empty());
  EXPECT_EQ(store_->request_cancel("jobs/none", 0).error().reason, "JOB_NOT_FOUND");
}

TEST_P(JobStoreConformance, DoesNotBlameAJobForWorkersThatAreKilled) {
  const std::string worker = "worker" + std::string(kIsolating);
  Ending crash;
  crash.state = kPending;
  crash.lost = "crashed (signal 11)";
  const std::string name = submit();
  for (int loss = 1; loss < 10; ++loss) {
    claim(worker);
    EXPECT_EQ((*store_->take_back(worker, {}))[0].job.state(), kPending) << loss;
  }
  EXPECT_EQ(store_->finish(claim(worker), crash, 0)->job.state(), kPending);
  claim(worker);
  EXPECT_EQ((*store_->take_back(worker, {}))[0].job.state(), kFailed) << "it may be that it ends whole machines";
  EXPECT_NE(get(name).error().message().find("10 times"), std::string::npos);
  submit();
  claim(worker);
  store_->take_back(worker, {});
  for (int i = 0; i < 2; ++i) EXPECT_EQ(store_->finish(claim(worker), crash, 0)->job.state(), kPending);
  EXPECT_EQ(store_->finish(claim(worker), crash, 0)->job.state(), kFailed) << "three crashes count as before";
}

TEST_P(JobStoreConformance, KeepsACancelWhenTheAttemptIsLost) {
  const std::string lost = submit(), given_back = submit();
  claim();
  store_->request_cancel(lost, 0);
  EXPECT_EQ(store_->take_back("worker", {})->front().job.state(), kCancelled);
  const Claim claimed = claim();
  store_->request_cancel(given_back, 0);
  Ending ending;
  ending.state = kPending;
  EXPECT_EQ(store_->finish(claimed, ending, 0)->job.state(), kCancelled);
}

TEST_P(JobStoreConformance, KeepsHowAJobEnded) {
  const std::string good = submit(), bad = submit();
  ASSERT_TRUE(store_->finish(claim(), success(), 0));
  EXPECT_EQ(get(good).metrics().iterations(), 7);
  EXPECT_EQ(*store_->history_digest(good), "history");
  Ending failed;
  failed.error.emplace().set_message("Byte 0 is bad.");
  ASSERT_TRUE(store_->finish(claim(), failed, 0));
  EXPECT_EQ(get(bad).state(), kFailed);
  EXPECT_EQ(get(bad).error().message(), "Byte 0 is bad.");
  EXPECT_EQ(store_->events(bad)->back().state_change().error().message(), "Byte 0 is bad.");
}

TEST_P(JobStoreConformance, RemovesAJobAndReleasesItsReferences) {
  v1::JobSpec labelled = spec();
  (*labelled.mutable_labels())["colour"] = "red";
  const std::string name = submit(labelled);
  EXPECT_EQ(store_->remove(name).error().reason, "JOB_NOT_ENDED");
  ASSERT_TRUE(store_->finish(claim(), success(), 0));
  const auto removed = store_->remove(name);
  ASSERT_TRUE(removed);
  EXPECT_EQ(removed->released, (std::vector<std::string>{"mesh", "result", "history"}));
  EXPECT_EQ(store_->remove(name).error().reason, "JOB_NOT_FOUND");
  EXPECT_EQ(store_->events(name).error().reason, "JOB_NOT_FOUND");
  EXPECT_TRUE(store_->list({{}, {{"colour", "red"}}}, 10, "")->jobs.empty());
  EXPECT_TRUE(store_->references()->empty());
}

TEST_P(JobStoreConformance, NamesTheJobsThatEndedLongestAgo) {
  std::vector<std::string> ended;
  for (int i = 0; i < 4; ++i) submit();
  for (int i = 0; i < 4; ++i) {
    now_ += std::chrono::seconds(1);
    const Claim claimed = claim();
    store_->finish(claimed, success(), 0);
    ended.push_back(claimed.name);
  }
  submit();
  const auto beyond = store_->ended_beyond(2, now_ + std::chrono::hours(1));
  EXPECT_EQ(std::set<std::string>(beyond->begin(), beyond->end()), (std::set<std::string>{ended[0], ended[1]}));
  EXPECT_TRUE(store_->ended_beyond(4, now_ + std::chrono::hours(1))->empty());
  EXPECT_TRUE(store_->ended_beyond(0, now_ - std::chrono::hours(1))->empty()) << "too young, however many there are";
}

// ===== outliving the process =====

TEST_P(DurableJobStoreConformance, IsTheSameAfterItIsReopened) {
  ASSERT_TRUE(store_->durable());
  v1::JobSpec labelled = spec();
  (*labelled.mutable_labels())["colour"] = "red";
  const std::string done = submit(), running = submit(labelled), waiting = submit();
  ASSERT_TRUE(store_->finish(claim(), success(), 12));
  const Claim claimed = claim();
  ASSERT_TRUE(store_->note_checkpoint(claimed, {"checkpoint", 5}));
  const auto before = store_->list({}, 100, "");
  const auto events = store_->events(done);
  const auto references = store_->references();

  reopen();
  const auto after = store_->list({}, 100, "");
  ASSERT_EQ(after->jobs.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(after->jobs[i].SerializeAsString(), before->jobs[i].SerializeAsString());
  ASSERT_EQ(store_->events(done)->size(), events->size());
  for (std::size_t i = 0; i < events->size(); ++i)
    EXPECT_EQ((*store_->events(done))[i].SerializeAsString(), (*events)[i].SerializeAsString());
  EXPECT_EQ(*store_->references(), *references);
  EXPECT_EQ(store_->list({{kRunning}, {{"colour", "red"}}}, 10, "")->jobs.size(), 1u);
  ASSERT_TRUE(store_->renew_lease(claimed)) << "a claim outlives the process too";
  ASSERT_EQ(store_->take_back("worker", {})->size(), 1u);
  const Claim second = claim();
  EXPECT_EQ(second.name, running) << "it keeps its place in the queue";
  EXPECT_EQ(second.checkpoint->digest, "checkpoint");
  EXPECT_EQ(claim().name, waiting);
  EXPECT_EQ(try_submit("", spec())->job.state(), kPending);
}

}  // namespace
}  // namespace varimesh::server::testing
