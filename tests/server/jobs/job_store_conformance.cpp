// The tests of submitting, listing and claiming. The stores are in job_stores.h.
#include "tests/server/jobs/job_store_conformance.h"

#include <set>
#include <thread>

#include "server/jobs/event_log.h"
#include "server/jobs/timestamps.h"

namespace varimesh::server::testing {
namespace {

// ===== submitting =====

TEST_P(JobStoreConformance, KeepsAJobAsItWasSubmitted) {
  v1::JobSpec wanted = spec("digest");
  wanted.mutable_options()->set_max_iterations(7);
  (*wanted.mutable_labels())["colour"] = "red";
  const auto submitted = try_submit("id", wanted);
  ASSERT_TRUE(submitted);
  ASSERT_EQ(submitted->events.size(), 1u);
  EXPECT_EQ(submitted->events[0].sequence(), 1);
  const v1::Job job = get(submitted->job.name());
  EXPECT_EQ(job.SerializeAsString(), submitted->job.SerializeAsString());
  EXPECT_EQ(job.state(), kPending);
  EXPECT_EQ(job.spec().SerializeAsString(), wanted.SerializeAsString());
  EXPECT_EQ(job.request_id(), "id");
  EXPECT_EQ(time_point(job.create_time()), now_);
  EXPECT_EQ(store_->get("jobs/none").error().reason, "JOB_NOT_FOUND");
}

TEST_P(JobStoreConformance, MakesOneJobPerRequest) {
  const auto first = try_submit("id", spec());
  const auto again = try_submit("id", spec());
  ASSERT_TRUE(again);
  EXPECT_EQ(again->job.name(), first->job.name());
  EXPECT_TRUE(again->events.empty());
  EXPECT_EQ(try_submit("id", spec("other")).error().reason, "REQUEST_ID_USED");
  const Claim claimed = claim();
  ASSERT_TRUE(store_->finish(claimed, success(), 0));
  EXPECT_EQ(try_submit("id", spec())->job.state(), kSucceeded) << "even after it has ended";
  ASSERT_TRUE(store_->remove(claimed.name));
  EXPECT_NE(try_submit("id", spec())->job.name(), first->job.name()) << "the request id was deleted with its job";
}

TEST_P(JobStoreConformance, MakesOneJobPerRequestInParallel) {
  std::vector<std::string> names(10);
  std::vector<std::thread> clients;
  for (std::size_t i = 0; i < names.size(); ++i)
    clients.emplace_back([&, i] {
      names[i] = store_->submit({"id", spec(), "jobs/" + std::to_string(i), 1000, {}, 0})->job.name();
    });
  for (std::thread& client : clients) client.join();
  for (const std::string& name : names) EXPECT_EQ(name, names.front());
  EXPECT_EQ(store_->list({}, 100, "")->jobs.size(), 1u);
}

TEST_P(JobStoreConformance, LimitsTheWaitingJobs) {
  ASSERT_TRUE(try_submit("a", spec(), 2));
  ASSERT_TRUE(try_submit("b", spec(), 2));
  EXPECT_EQ(try_submit("c", spec(), 2).error().reason, "QUEUE_FULL");
  EXPECT_TRUE(try_submit("a", spec(), 2)) << "that job already waits";
  claim();
  EXPECT_TRUE(try_submit("c", spec(), 2));
}

TEST_P(JobStoreConformance, LimitsTheWaitingJobsOfAPeer) {
  const auto try_as = [&](const std::string& peer, int most) {
    return store_->submit({"", spec(), "jobs/" + std::to_string(++names_), 1000, peer, most});
  };
  ASSERT_TRUE(try_as("a", 2));
  ASSERT_TRUE(try_as("a", 2));
  const auto refused = try_as("a", 2);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, "PEER_LIMIT");
  EXPECT_GT(refused.error().retry_seconds, 0);
  EXPECT_TRUE(try_as("b", 2)) << "another peer";
  EXPECT_TRUE(try_as("a", 0)) << "no limit";
  for (int i = 0; i < 3; ++i) claim();
  EXPECT_TRUE(try_as("a", 2)) << "running jobs do not count";
}

TEST_P(JobStoreConformance, LimitsTheRunningJobsOfAPeer) {
  max_running_of_peer_ = 2;
  reopen();
  for (const char* peer : {"a", "a", "a", "b"}) {
    now_ += std::chrono::milliseconds(1);
    ASSERT_TRUE(store_->submit({"", spec(), "jobs/" + std::to_string(++names_), 1000, peer, 0}));
  }
  const Claim first = claim();
  EXPECT_EQ(first.name, "jobs/1");
  const std::set<std::string> others{claim().name, claim().name};
  EXPECT_EQ(others, (std::set<std::string>{"jobs/2", "jobs/4"})) << "two jobs of a are running";
  EXPECT_FALSE(*store_->claim("worker"));
  ASSERT_TRUE(store_->finish(first, success(), 0));
  EXPECT_EQ(claim().name, "jobs/3");
}

TEST_P(JobStoreConformance, DoesNotLimitRunningJobsWithoutAPeer) {
  max_running_of_peer_ = 1;
  reopen();
  submit();
  submit();
  EXPECT_EQ(claim().name, "jobs/1");
  const auto second = store_->claim("worker");
  ASSERT_TRUE(second && *second);
  EXPECT_EQ((*second)->claim.name, "jobs/2");
}

// ===== owners =====

TEST_P(JobStoreConformance, GivesEachOwnerRequestIdsOfItsOwn) {
  const auto submit_as = [&](const std::string& owner, const v1::JobSpec& spec) {
    return store_->submit({"run 1", spec, "jobs/" + std::to_string(++names_), 1000, "peer", 0, owner});
  };
  const auto of_ann = submit_as("ann", spec("a"));
  ASSERT_TRUE(of_ann);
  EXPECT_EQ(of_ann->job.owner(), "ann");
  const auto of_bob = submit_as("bob", spec("b"));
  ASSERT_TRUE(of_bob) << "Bob's id says nothing about Ann's";
  EXPECT_NE(of_bob->job.name(), of_ann->job.name());
  EXPECT_FALSE(of_bob->events.empty());
  const auto again = submit_as("ann", spec("a"));
  ASSERT_TRUE(again);
  EXPECT_EQ(again->job.name(), of_ann->job.name());
  EXPECT_TRUE(again->events.empty());
  EXPECT_EQ(submit_as("bob", spec("a")).error().reason, "REQUEST_ID_USED");
  ASSERT_TRUE(submit_as("", spec("c"))) << "nobody's jobs have ids of their own too";
  EXPECT_EQ(get(of_bob->job.name()).owner(), "bob");
  EXPECT_EQ(claim().owner, "ann");
  store_->request_cancel(of_bob->job.name(), 0);
  ASSERT_TRUE(store_->remove(of_bob->job.name()));
  const auto anew = submit_as("bob", spec("b"));
  EXPECT_FALSE(anew->events.empty()) << "the job of this id was deleted";
  EXPECT_EQ(submit_as("ann", spec("a"))->job.name(), of_ann->job.name());
}

TEST_P(JobStoreConformance, ListsTheJobsOfAnOwner) {
  std::vector<std::string> of_ann;
  for (const char* owner : {"ann", "bob", "ann", "", "ann"}) {
    v1::JobSpec labelled = spec();
    (*labelled.mutable_labels())["case"] = "wing";
    const auto made = store_->submit({"", labelled, "jobs/" + std::to_string(++names_), 1000, "peer", 0, owner});
    if (std::string(owner) == "ann") of_ann.insert(of_ann.begin(), made->job.name());
  }
  JobFilter filter;
  filter.owner = "ann";
  filter.labels = {{"case", "wing"}};
  std::vector<std::string> listed;
  std::string token;
  do {
    const auto page = store_->list(filter, 2, token);
    for (const v1::Job& job : page->jobs) listed.push_back(job.name());
    token = page->next_page_token;
  } while (!token.empty());
  EXPECT_EQ(listed, of_ann);
  filter.owner = "";
  EXPECT_EQ(store_->list(filter, 10, "")->jobs.size(), 1u) << "nobody's jobs, not everybody's";
  filter.owner = "an";
  EXPECT_TRUE(store_->list(filter, 10, "")->jobs.empty());
  filter.owner.reset();
  EXPECT_EQ(store_->list(filter, 10, "")->jobs.size(), 5u);
  EXPECT_EQ(store_->references()->front(), (Reference{"mesh", "ann"}));
}

// ===== listing =====

TEST_P(JobStoreConformance, ListsPagesThatNewJobsDoNotShift) {
  std::vector<std::string> all;
  for (int i = 0; i < 5; ++i) all.push_back(submit());
  std::reverse(all.begin(), all.end());
  std::vector<std::string> listed;
  std::string token;
  do {
    const auto page = store_->list({}, 2, token);
    ASSERT_TRUE(page);
    for (const v1::Job& job : page->jobs) listed.push_back(job.name());
    token = page->next_page_token;
    submit();
  } while (!token.empty());
  EXPECT_EQ(listed, all);
  EXPECT_EQ(store_->list({}, 2, "nonsense").error().code, Failure::Code::InvalidArgument);
}

TEST_P(JobStoreConformance, EndsAPageBeforeItIsTooLarge) {
  const auto wide = [] {
    v1::JobSpec spec = JobStoreConformance::spec();
    for (int i = 0; i < 1000; ++i) spec.mutable_options()->add_fix_nodes(1'000'000'000 + i);
    return spec;
  };
  for (int i = 0; i < 7; ++i) submit(wide());
  JobFilter filter;
  filter.most_bytes = 3 * wide().ByteSizeLong() + 1000;
  std::vector<std::size_t> pages;
  std::set<std::string> names;
  std::string token;
  do {
    const auto page = store_->list(filter, 100, token);
    ASSERT_TRUE(page);
    pages.push_back(page->jobs.size());
    for (const v1::Job& job : page->jobs) names.insert(job.name());
    token = page->next_page_token;
  } while (!token.empty());
  EXPECT_EQ(pages, (std::vector<std::size_t>{3, 3, 1}));
  EXPECT_EQ(names.size(), 7u);
  filter.most_bytes = 1;
  EXPECT_EQ(store_->list(filter, 100, "")->jobs.size(), 1u) << "a page is never empty";
}

TEST_P(JobStoreConformance, FiltersByStatesAndLabels) {
  v1::JobSpec red = spec();
  (*red.mutable_labels())["colour"] = "red";
  v1::JobSpec large_red = red;
  (*large_red.mutable_labels())["size"] = "large";
  const std::string plain = submit(), first = submit(red), second = submit(large_red);
  ASSERT_TRUE(store_->request_cancel(first, 0));
  const auto names = [&](const JobFilter& filter) {
    std::vector<std::string> found;
    const auto page = store_->list(filter, 100, "");
    for (const v1::Job& job : page->jobs) found.push_back(job.name());
    return found;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names({{}, {{"colour", "red"}}}), (Names{second, first}));
  EXPECT_EQ(names({{kPending}, {{"colour", "red"}}}), Names{second});
  EXPECT_EQ(names({{kPending, kCancelled}, {}}), (Names{second, first, plain}));
  EXPECT_EQ(names({{}, {{"colour", "red"}, {"size", "large"}}}), Names{second});
  EXPECT_EQ(names({{}, {{"colour", "large"}}}), Names{});
}

// ===== claiming and leases =====

TEST_P(JobStoreConformance, GivesJobsInOrderOfArrival) {
  const std::string first = submit(), second = submit();
  const auto claimed = store_->claim("worker");
  ASSERT_TRUE(claimed && *claimed);
  EXPECT_EQ((*claimed)->claim.name, first);
  EXPECT_EQ((*claimed)->claim.attempt, 1);
  ASSERT_EQ((*claimed)->events.size(), 1u);
  EXPECT_EQ((*claimed)->events[0].state_change().state(), kRunning);
  EXPECT_EQ(get(first).state(), kRunning);
  EXPECT_EQ(store_->counts()->running, 1);
  EXPECT_EQ(store_->counts()->pending, 1);
  EXPECT_EQ(claim().name, second);
  EXPECT_FALSE(*store_->claim("worker"));
}

TEST_P(JobStoreConformance, PrefersPriorityWithoutLettingAJobWaitForEver) {
  const std::string old = submit();
  now_ += kPriorityStep * 3;
  v1::JobSpec urgent = spec(), lowly = spec();
  urgent.set_priority(2);
  lowly.set_priority(-1);
  const std::string low = submit(lowly), plain = submit(), high = submit(urgent);
  EXPECT_EQ(claim().name, old) << "three steps of waiting outweigh two of priority";
  EXPECT_EQ(claim().name, high);
  EXPECT_EQ(claim().name, plain);
  EXPECT_EQ(claim().name, low);
}

TEST_P(JobStoreConformance, GivesEachJobToOneWorker) {
  for (int i = 0; i < 40; ++i) submit();
  std::vector<std::vector<std::string>> names(4);
  std::vector<std::thread> workers;
  for (std::size_t i = 0; i < names.size(); ++i)
    workers.emplace_back([&, i] {
      while (const auto claimed = *store_->claim("worker " + std::to_string(i)))
        names[i].push_back(claimed->claim.name);
    });
  for (std::thread& worker : workers) worker.join();
  std::set<std::string> all;
  std::size_t count = 0;
  for (const auto& some : names) {
    all.insert(some.begin(), some.end());
    count += some.size();
  }
  EXPECT_EQ(count, 40u);
  EXPECT_EQ(all.size(), 40u);
}

TEST_P(JobStoreConformance, TakesBackAJobWhoseLeaseHasExpired) {
  const std::string name = submit();
  const Claim lost = claim("one");
  now_ += std::chrono::seconds(20);
  ASSERT_TRUE(store_->renew_lease(lost));
  now_ += std::chrono::seconds(20);
  EXPECT_TRUE(store_->take_back("another", {})->empty()) << "renewed 20 s ago";
  now_ += std::chrono::seconds(10);
  const auto taken = store_->take_back("another", {});
  ASSERT_EQ(taken->size(), 1u);
  EXPECT_EQ(taken->front().job.state(), kPending);
  ASSERT_EQ(taken->front().events.size(), 1u);

  const Claim second = claim("another");
  EXPECT_EQ(second.name, name);
  EXPECT_EQ(second.attempt, 2);
  // The first worker continues, but its claim is not valid any more.
  EXPECT_EQ(store_->renew_lease(lost).error().reason, "CLAIM_LOST");
  EXPECT_EQ(store_->note_progress(lost, {}, 100).error().reason, "CLAIM_LOST");
  EXPECT_EQ(store_->note_checkpoint(lost, {"digest", 1}).error().reason, "CLAIM_LOST");
  EXPECT_EQ(store_->finish(lost, success(), 0).error().reason, "CLAIM_LOST");
  EXPECT_EQ(get(name).state(), kRunning);
  ASSERT_TRUE(store_->finish(second, success(), 0));
  EXPECT_EQ(store_->finish(second, success(), 0).error().reason, "CLAIM_LOST") << "a job has one result";
  EXPECT_EQ(get(name).results_size(), 1);
  EXPECT_EQ(states(name), (std::vector<State>{kPending, kRunning, kPending, kRunning, kSucceeded}));
}

TEST_P(JobStoreConformance, TakesBackAllJobsOfAWorkerThatRestarts) {
  const std::string mine = submit(), others = submit();
  claim("me");
  claim("other");
  const auto taken = store_->take_back("me", {});
  ASSERT_EQ(taken->size(), 1u);
  EXPECT_EQ(taken->front().job.name(), mine);
  EXPECT_EQ(get(others).state(), kRunning);
}

TEST_P(JobStoreConformance, DoesNotTakeBackJobsThatTheCallerRuns) {
  const std::string mine = submit(), others = submit();
  const Claim claimed = claim("me");
  claim("other");
  now_ += std::chrono::seconds(40);
  const auto taken = store_->take_back("", {mine});
  ASSERT_EQ(taken->size(), 1u);
  EXPECT_EQ(taken->front().job.name(), others);
  ASSERT_TRUE(store_->renew_lease(claimed)) << "late, but still valid";
  EXPECT_TRUE(store_->take_back("", {})->empty());
}

TEST_P(JobStoreConformance, FailsAJobThatWasLostThreeTimes) {
  const std::string name = submit();
  for (int attempt = 1; attempt <= 3; ++attempt) {
    EXPECT_EQ(claim().attempt, attempt);
    ASSERT_EQ(store_->take_back("worker", {})->size(), 1u);
  }
  const v1::Job job = get(name);
  EXPECT_EQ(job.state(), kFailed);
  EXPECT_EQ(job.error().reason(), "LOST");
  EXPECT_NE(job.error().message().find("3 times"), std::string::npos) << job.error().message();
  EXPECT_TRUE(job.has_end_time());
  EXPECT_FALSE(*store_->claim("worker"));
  EXPECT_EQ(store_->events(name)->back().state_change().error().reason(), "LOST");
}

TEST_P(JobStoreConformance, DoesNotCountAttemptsThatWereGivenBack) {
  const std::string name = submit();
  Ending given_back;
  given_back.state = kPending;
  for (int i = 0; i < 5; ++i) {
    const auto back = store_->finish(claim(), given_back, 0);
    ASSERT_TRUE(back);
    EXPECT_EQ(back->job.state(), kPending);
  }
  EXPECT_EQ(claim().name, name);
}

TEST_P(JobStoreConformance, NumbersEventsAfterThoseThatWereSeen) {
  const std::string name = submit();
  const Claim first = claim();
  ASSERT_TRUE(store_->note_progress(first, {}, 50));
  EXPECT_EQ(get(name).last_sequence(), 50);
  EXPECT_EQ(store_->request_cancel(name, 60)->events[0].sequence(), 61);
  const auto finished = store_->finish(first, success(), 70);
  ASSERT_EQ(finished->events.size(), 3u);
  EXPECT_EQ(finished->events[0].sequence(), 71);
  EXPECT_EQ(finished->events[0].quality().stage(), v1::QualityEvent::STAGE_BEFORE);
  EXPECT_EQ(finished->events[1].quality().report().invalid_elements(), 1);
  EXPECT_EQ(finished->events[2].sequence(), 73);
  EXPECT_EQ(get(name).last_sequence(), 73);

  const std::string lost = submit();
  claim();
  EXPECT_EQ(store_->take_back("worker", {})->front().events[0].sequence(), kSequenceRange + 1)
      << "nobody knows which numbers the lost attempt has used";
  EXPECT_EQ((*store_->claim("worker"))->events[0].sequence(), kSequenceRange + 2);
  states(lost);
}

}  // namespace
}  // namespace varimesh::server::testing
