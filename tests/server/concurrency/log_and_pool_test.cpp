// The queue, the log of events and the registry of calls, used by many threads at once.
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "server/api/calls.h"
#include "server/jobs/event_log.h"
#include "server/jobs/pool.h"
#include "tests/server/watch_guarantees.h"

namespace varimesh::server::testing {
namespace {

TEST(PoolConcurrency, RunsEverythingThatIsPostedOnce) {
  std::vector<int> runs(2000, 0);
  {
    Pool pool(4);
    std::vector<std::thread> posters;
    for (std::size_t poster = 0; poster < 4; ++poster)
      posters.emplace_back([&, poster] {
        for (std::size_t i = poster; i < runs.size(); i += 4) pool.post([&runs, i] { ++runs[i]; });
      });
    for (std::thread& poster : posters) poster.join();
  }
  for (const int count : runs) EXPECT_EQ(count, 1);
}

/// Wakes whoever waits.
class Bell : public Listener {
 public:
  void poke() override {
    std::lock_guard lock(mutex_);
    rung_ = true;
    changed_.notify_all();
  }
  void wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return std::exchange(rung_, false); });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool rung_ = false;
};

/// Watches a log to its end in streams of at most `cut` events.
WatchHistory watch(EventLog& log, std::size_t cut) {
  WatchHistory history(1);
  std::int64_t last = 0;
  auto bell = std::make_shared<Bell>();
  log.subscribe(bell);
  while (true) {
    v1::JobEvent event;
    switch (log.next(last, {}, {}, &event)) {
      case EventLog::Next::End:
        return history;
      case EventLog::Next::Wait:
        bell->wait();
        break;
      case EventLog::Next::Event:
        last = event.sequence();
        history.back().events.push_back(std::move(event));
        if (history.back().events.size() < cut) break;
        history.push_back({last, {}});
        bell = std::make_shared<Bell>();
        log.subscribe(bell);
    }
  }
}

TEST(EventLogConcurrency, KeepsItsGuaranteesForEveryWatcher) {
  constexpr int kIterations = 3000;
  EventLog log({100'000, 64});
  std::vector<WatchHistory> histories(6);
  std::vector<std::thread> watchers;
  for (std::size_t i = 0; i < histories.size(); ++i)
    watchers.emplace_back([&, i] { histories[i] = watch(log, 7 + 40 * i); });
  std::vector<v1::JobEvent> truth;
  std::mutex truth_mutex;
  std::vector<std::thread> writers;
  for (int writer = 0; writer < 2; ++writer)
    writers.emplace_back([&, writer] {
      for (int i = 0; i < kIterations; ++i) {
        v1::JobEvent event;
        if (i % 100 == 0)
          event.mutable_quality()->set_stage(v1::QualityEvent::STAGE_BEFORE);
        else
          event.mutable_iteration()->set_number(writer * kIterations + i);
        std::lock_guard lock(truth_mutex);
        event.set_sequence(log.append(event));
        truth.push_back(std::move(event));
      }
    });
  for (std::thread& writer : writers) writer.join();
  log.close();
  for (std::thread& watcher : watchers) watcher.join();
  for (const WatchHistory& history : histories) {
    EXPECT_EQ(broken_order(history), "");
    EXPECT_EQ(broken_uniqueness(history), "");
    EXPECT_EQ(broken_reliability(history, truth), "");
    EXPECT_EQ(broken_resumption(history), "");
  }
}

/// A call that leaves the registry when it is ended, as streams do.
class FakeCall : public Call, public std::enable_shared_from_this<FakeCall> {
 public:
  explicit FakeCall(CallRegistry* calls) : calls_(calls) {}
  void end(const grpc::Status&) override {
    if (!ended_.exchange(true)) calls_->remove(shared_from_this());
  }
  void tick(std::chrono::steady_clock::time_point) override { ++ticks; }
  std::atomic<int> ticks = 0;

 private:
  CallRegistry* const calls_;
  std::atomic<bool> ended_ = false;
};

TEST(CallRegistryConcurrency, EndsEveryCallThatComesBeforeOrAfter) {
  CallRegistry calls;
  std::atomic<bool> stopping = false;
  std::atomic<int> refused = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i)
    threads.emplace_back([&] {
      for (int call = 0; call < 500; ++call) {
        const auto made = std::make_shared<FakeCall>(&calls);
        if (!calls.add(made)) {
          ++refused;
          made->end({});
        } else if (call % 2 == 0) {
          made->end({});
        }
      }
    });
  threads.emplace_back([&] {
    while (!stopping) calls.tick(std::chrono::steady_clock::now());
  });
  calls.end_all({});
  for (std::size_t i = 0; i < 4; ++i) threads[i].join();
  stopping = true;
  threads.back().join();
  EXPECT_TRUE(calls.wait_empty(std::chrono::steady_clock::now() + std::chrono::seconds(10)));
  EXPECT_EQ(calls.size(), 0u);
}

}  // namespace
}  // namespace varimesh::server::testing
