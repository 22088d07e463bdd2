// What the scheduler gives to each of several owners. One thread runs the jobs, one after another, so that their order
// is known.
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>

#include "server/meshes/directory_mesh_store.h"
#include "server/scheduling/scheduler.h"
#include "tests/server/jobs/job_stores.h"

namespace varimesh::server::testing {
namespace {

class SchedulerLimits : public ::testing::TestWithParam<StoreKind> {
 protected:
  SchedulerLimits() : place_(GetParam().make()) {
    settings_.new_name = [this] { return "jobs/" + std::to_string(++names_); };
    settings_.launch = [this](int, SchedulerSettings::Job job) { launched_.push_back(std::move(job)); };
    settings_.clock = [this] { return now_; };
    settings_.steady = [this] { return SteadyTime(now_.time_since_epoch()); };
    settings_.renewal_interval = std::chrono::seconds(0);
  }
  ~SchedulerLimits() override {
    if (scheduler_ == nullptr) return;
    scheduler_->stop();
    while (!launched_.empty()) run_one();
    EXPECT_TRUE(scheduler_->drain(std::chrono::steady_clock::now() + std::chrono::seconds(30)));
  }

  void start() {
    JobStoreSettings store;
    store.clock = [this] { return now_; };
    jobs_ = place_->open(store);
    meshes_ = std::move(*DirectoryMeshStore::create(::testing::TempDir(), {}));
    Engine engine;
    engine.check_options = [](const Options&) -> Expected<void> { return {}; };
    engine.run = [this](RunRequest request, const RunHooks& hooks) -> Expected<RunSummary> {
      order_.emplace_back(request.input->bytes());
      EXPECT_TRUE(hooks.open_output(v1::MESH_FORMAT_MSH22)("result of " + order_.back()));
      return RunSummary();
    };
    scheduler_ = std::make_unique<Scheduler>(jobs_.get(), meshes_.get(), std::move(engine), settings_);
  }
  Answer<v1::Job> submit(const std::string& owner, int priority = 0, bool is_admin = false,
                         const std::string& request_id = "") {
    auto writer = std::move(*meshes_->create());
    EXPECT_TRUE(writer->append(owner));
    v1::JobSpec spec;
    spec.mutable_mesh()->set_digest(writer->commit()->digest);
    spec.set_priority(priority);
    return scheduler_->submit(request_id, spec, false, {owner, owner, is_admin});
  }
  void run_one() {
    const auto job = std::move(launched_.front());
    launched_.pop_front();
    job({[] { return 1; }});
  }
  static std::string reason_of(const Answer<v1::Job>& job) { return job ? "accepted" : job.error().reason; }

  TimePoint now_ = TimePoint(std::chrono::hours(400'000));
  SchedulerSettings settings_;
  std::unique_ptr<StorePlace> place_;
  std::unique_ptr<JobStore> jobs_;
  std::unique_ptr<DirectoryMeshStore> meshes_;
  std::deque<SchedulerSettings::Job> launched_;
  std::vector<std::string> order_;  ///< The owners of the jobs that ran.
  int names_ = 0;
  std::unique_ptr<Scheduler> scheduler_;
};
INSTANTIATE_TEST_SUITE_P(Stores, SchedulerLimits, ::testing::ValuesIn(kStores), name_of);

TEST_P(SchedulerLimits, AFloodOfOneOwnerDelaysTheOthersByOneJobEach) {
  start();
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(submit("flood", 100));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(submit("ann", -100));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(submit("bob"));
  for (int i = 0; i < 11; ++i) run_one();
  EXPECT_EQ(std::ranges::count(order_, "ann"), 3);
  EXPECT_EQ(std::ranges::count(order_, "bob"), 3);
  while (!launched_.empty()) run_one();
  EXPECT_EQ(std::ranges::count(order_, "flood"), 200);
}

TEST_P(SchedulerLimits, OfSubmissionsInAMinute) {
  settings_.max_submissions = 6;
  start();
  for (int i = 0; i < 6; ++i) EXPECT_EQ(reason_of(submit("ann")), "accepted") << i;
  const auto refused = submit("ann");
  ASSERT_EQ(reason_of(refused), "PEER_LIMIT");
  EXPECT_EQ(refused.error().retry_seconds, 10);
  EXPECT_EQ(reason_of(submit("bob")), "accepted") << "others have a minute of their own";
  now_ += std::chrono::seconds(9);
  EXPECT_EQ(reason_of(submit("ann")), "PEER_LIMIT");
  now_ += std::chrono::seconds(1);
  EXPECT_EQ(reason_of(submit("ann", 0, false, "run")), "accepted");
  EXPECT_EQ(reason_of(submit("ann")), "PEER_LIMIT");
  now_ += std::chrono::seconds(10);
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(reason_of(submit("ann", 0, false, "run")), "accepted") << "a call that is repeated makes no job";
  now_ += std::chrono::hours(1);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(reason_of(submit("ann")), "accepted") << i;
  EXPECT_EQ(reason_of(submit("ann")), "PEER_LIMIT") << "nobody saves up more than a minute";
}

TEST_P(SchedulerLimits, OfPrioritiesDoNotHoldForAdmins) {
  settings_.max_priority = 3;
  start();
  EXPECT_EQ(reason_of(submit("ann", 3)), "accepted");
  const auto refused = submit("ann", 4);
  ASSERT_EQ(reason_of(refused), "BAD_REQUEST");
  EXPECT_NE(refused.error().sentence.find("from -100 to 3"), std::string::npos) << refused.error().sentence;
  EXPECT_EQ(reason_of(submit("operator", 100, true)), "accepted");
  EXPECT_EQ(reason_of(submit("operator", 101, true)), "BAD_REQUEST");
}

TEST_P(SchedulerLimits, OfEndedJobsHoldForEachOwner) {
  settings_.max_ended = 5;
  settings_.max_ended_age = std::chrono::hours(48);
  start();
  const std::string kept = submit("ann")->name();
  run_one();
  std::string last;
  for (int i = 0; i < 40; ++i) {
    now_ += std::chrono::seconds(1);
    last = submit("flood")->name();
    run_one();
  }
  EXPECT_TRUE(scheduler_->get(kept)) << "the jobs of others have not pushed it out";
  EXPECT_EQ(scheduler_->list({}, 1000, "")->jobs.size(), 6u);
  const std::string digest = scheduler_->get(kept)->results(0).digest();
  EXPECT_TRUE(meshes_->size_of(digest));
  now_ += std::chrono::hours(47);
  scheduler_->tick();
  EXPECT_TRUE(scheduler_->get(kept));
  now_ += std::chrono::hours(1) + std::chrono::seconds(1);
  scheduler_->tick();
  EXPECT_FALSE(scheduler_->get(kept)) << "it is too old";
  EXPECT_FALSE(scheduler_->get(last));
  EXPECT_FALSE(meshes_->size_of(digest)) << "so is its result";
}

}  // namespace
}  // namespace varimesh::server::testing
