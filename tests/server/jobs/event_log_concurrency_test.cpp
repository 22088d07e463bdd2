// The event log, used by many threads at the same time.
#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>
#include <thread>

#include "server/jobs/event_log.h"
#include "tests/server/watch_guarantees.h"

namespace varimesh::server::testing {
namespace {

/// Wakes the thread that waits.
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

/// Watches a log to its end, in streams of at most `cut` events.
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

}  // namespace
}  // namespace varimesh::server::testing
