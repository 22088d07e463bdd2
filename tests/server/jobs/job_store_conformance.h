// The tests that every job store must pass. One line in job_stores.h adds a new store to them.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include "server/jobs/job_store.h"

namespace varimesh::server::testing {

using State = v1::JobState;
inline constexpr State kPending = v1::JOB_STATE_PENDING, kRunning = v1::JOB_STATE_RUNNING,
                       kCancelling = v1::JOB_STATE_CANCELLING, kSucceeded = v1::JOB_STATE_SUCCEEDED,
                       kFailed = v1::JOB_STATE_FAILED, kCancelled = v1::JOB_STATE_CANCELLED;

/// A store under test, and the place where it keeps its jobs. Each test has its own.
class StorePlace {
 public:
  virtual ~StorePlace() = default;
  /// Opens the store. If it was open before and was closed, it has what it has kept.
  virtual std::unique_ptr<JobStore> open(const JobStoreSettings& settings) = 0;
};

/// A kind of job store, with its name in the names of the tests.
struct StoreKind {
  const char* name;
  std::function<std::unique_ptr<StorePlace>()> make;
};

inline void PrintTo(const StoreKind& kind, std::ostream* out) { *out << kind.name; }
inline std::string name_of(const ::testing::TestParamInfo<StoreKind>& kind) { return kind.param.name; }

/// A store with a clock that the test controls.
class JobStoreConformance : public ::testing::TestWithParam<StoreKind> {
 protected:
  JobStoreConformance() : place_(GetParam().make()) { reopen(); }

  void reopen() {
    store_.reset();
    JobStoreSettings settings;
    settings.clock = [this] { return now_; };
    settings.lease = std::chrono::seconds(30);
    settings.max_attempts = 3;
    settings.max_running_of_peer = max_running_of_peer_;
    store_ = place_->open(settings);
  }

  static v1::JobSpec spec(const std::string& digest = "mesh") {
    v1::JobSpec spec;
    spec.mutable_mesh()->set_digest(digest);
    return spec;
  }
  Answer<Changed> try_submit(const std::string& request_id, const v1::JobSpec& spec, int max_pending = 1000) {
    return store_->submit({request_id, spec, "jobs/" + std::to_string(++names_), max_pending, {}, 0});
  }
  std::string submit(const v1::JobSpec& spec = JobStoreConformance::spec()) {
    now_ += std::chrono::milliseconds(1);
    return try_submit("", spec)->job.name();
  }
  Claim claim(const std::string& worker = "worker") { return (*store_->claim(worker))->claim; }
  v1::Job get(const std::string& name) { return *store_->get(name); }

  static Ending success() {
    Ending ending;
    ending.state = v1::JOB_STATE_SUCCEEDED;
    ending.metrics.emplace().set_iterations(7);
    ending.metrics->mutable_after()->set_invalid_elements(1);
    ending.results.emplace_back().set_digest("result");
    ending.history_digest = "history";
    return ending;
  }
  /// Returns the states in the events of a job, and checks their numbers.
  std::vector<v1::JobState> states(const std::string& name) {
    std::vector<v1::JobState> states;
    std::int64_t last = 0;
    const auto events = store_->events(name);
    for (const v1::JobEvent& event : *events) {
      EXPECT_GT(event.sequence(), last);
      last = event.sequence();
      if (event.has_state_change()) states.push_back(event.state_change().state());
    }
    EXPECT_GE(get(name).last_sequence(), last);
    return states;
  }

  TimePoint now_ = TimePoint(std::chrono::hours(400'000));
  std::unique_ptr<StorePlace> place_;
  std::unique_ptr<JobStore> store_;
  int names_ = 0;
  int max_running_of_peer_ = 0;  ///< Takes effect at the next reopen().
};

/// Peers take turns.
class FairTurns : public JobStoreConformance {
 protected:
  std::string submit_as(const std::string& peer, int priority = 0, bool needs_device = false) {
    now_ += std::chrono::milliseconds(1);
    v1::JobSpec wanted = spec();
    wanted.set_priority(priority);
    const std::string name = "jobs/" + peer + std::to_string(++names_);
    EXPECT_TRUE(store_->submit({"", wanted, name, 10'000, peer, 0, peer, {}, needs_device}));
    return name;
  }
  /// Runs the next job to its end and returns its name.
  std::string run_next() {
    const auto claimed = *store_->claim("worker");
    if (!claimed) return "";
    now_ += std::chrono::seconds(1);
    EXPECT_TRUE(store_->finish(claimed->claim, success(), 0));
    return claimed->claim.name;
  }
};

/// The tests of stores whose jobs outlive the process.
class DurableJobStoreConformance : public JobStoreConformance {};

/// With jobs that have a webhook.
class Calls : public JobStoreConformance {
 protected:
  static v1::JobSpec with_webhook() {
    v1::JobSpec with = spec();
    with.mutable_webhook()->set_url("https://ci.example.org/");
    return with;
  }
  std::string end_one() {
    const std::string name = submit(with_webhook());
    EXPECT_TRUE(store_->finish(claim(), success(), 0));
    return name;
  }
  /// The name of the job whose webhook is to be called now; empty: none.
  std::string due() {
    const auto claimed = store_->claim_call(std::chrono::seconds(60));
    return claimed && *claimed ? (*claimed)->name() : "";
  }
};

class DurableCalls : public Calls {};

}  // namespace varimesh::server::testing
