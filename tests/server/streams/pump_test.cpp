// The writing half of a stream without gRPC: pokes, writes, ends and ticks from many threads.
#include "server/streams/pump.h"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "server/streams/event_source.h"
#include "tests/server/watch_guarantees.h"

namespace varimesh::server::testing {
namespace {

/// Accepts what a pump writes, and confirms each write on another thread, as gRPC does.
class FakeStream : public Listener {
 public:
  FakeStream(Pool& pool, const Limits& limits, Pool& reactions)
      : reactions_(reactions),
        pump_(pool, limits,
              {[this](const v1::JobEvent* event) { write(*event); }, [this](const grpc::Status&) { finish(); },
               [this] { ++cancels_; }}) {}

  void poke() override { pump_.poke(); }
  Pump<v1::JobEvent>& pump() { return pump_; }
  std::vector<v1::JobEvent> wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return finishes_ > 0; });
    EXPECT_EQ(finishes_, 1);
    EXPECT_FALSE(written_after_end_);
    return events_;
  }

 private:
  void write(const v1::JobEvent& event) {
    {
      std::lock_guard lock(mutex_);
      EXPECT_FALSE(std::exchange(writing_, true)) << "one write at a time";
      written_after_end_ = written_after_end_ || finishes_ > 0;
      events_.push_back(event);
    }
    reactions_.post([this] {
      {
        std::lock_guard lock(mutex_);
        writing_ = false;
      }
      pump_.on_write_done(true);
    });
  }
  void finish() {
    std::lock_guard lock(mutex_);
    ++finishes_;
    changed_.notify_all();
  }

  Pool& reactions_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<v1::JobEvent> events_;
  int finishes_ = 0;
  std::atomic<int> cancels_ = 0;
  bool writing_ = false;
  bool written_after_end_ = false;
  Pump<v1::JobEvent> pump_;
};

struct Streams {
  explicit Streams(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      streams.push_back(std::make_shared<FakeStream>(pool, limits, reactions));
      log.subscribe(streams.back());
      auto source = std::make_shared<EventSource>(std::shared_ptr<EventLog>(&log, [](EventLog*) {}), 0,
                                                  std::chrono::nanoseconds(0));
      streams.back()->pump().start(streams.back(), [source](v1::JobEvent* event, bool idle, grpc::Status*) {
        return source->pull(event, idle);
      });
    }
  }

  EventLog log;
  Limits limits;
  std::vector<std::shared_ptr<FakeStream>> streams;
  Pool reactions{2};
  Pool pool{2};  ///< Destroyed before the reactions, which it starts, and both before the streams.
};

TEST(PumpConcurrency, DeliversAllEventsToManyStreams) {
  Streams all(5);
  std::atomic<bool> done = false;
  std::thread ticker([&] {
    while (!done)
      for (const auto& stream : all.streams) stream->pump().tick(std::chrono::steady_clock::now());
  });
  std::vector<v1::JobEvent> truth;
  for (int i = 0; i < 500; ++i) {
    v1::JobEvent event;
    if (i % 10 == 0)
      event.mutable_state_change()->set_state(v1::JOB_STATE_RUNNING);
    else
      event.mutable_iteration()->set_number(i);
    event.set_sequence(all.log.append(event));
    truth.push_back(std::move(event));
  }
  all.log.close();
  for (const auto& stream : all.streams) {
    const WatchHistory history{{0, stream->wait()}};
    EXPECT_EQ(broken_order(history), "");
    EXPECT_EQ(broken_uniqueness(history), "");
    EXPECT_EQ(broken_reliability(history, truth), "");
    EXPECT_EQ(broken_resumption(history), "");
  }
  done = true;
  ticker.join();
}

TEST(EventSource, DeliversTheNewestWorkInABookmarkUntilTheNextEvent) {
  const auto log = std::make_shared<EventLog>();
  EventSource source(log, 0, {}), slow(log, 0, std::chrono::hours(1));
  const auto work = [](std::int64_t done) {
    v1::Work made;
    made.set_done(done);
    return made;
  };
  v1::JobEvent event;
  log->append(v1::JobEvent());
  EXPECT_EQ(source.pull(&event, false), Pull::Message);
  EXPECT_EQ(slow.pull(&event, false), Pull::Message);
  EXPECT_EQ(source.pull(&event, false), Pull::Wait);
  log->set_work(work(1));
  log->set_work(work(2));
  for (EventSource* each : {&source, &slow}) {
    event.Clear();
    ASSERT_EQ(each->pull(&event, false), Pull::Message);
    EXPECT_EQ(event.sequence(), 1) << "of the event before it";
    EXPECT_EQ(event.bookmark().work().done(), 2);
    EXPECT_EQ(each->pull(&event, false), Pull::Wait) << "each work once";
  }
  log->set_work(work(3));
  EXPECT_EQ(slow.pull(&event, false), Pull::Wait) << "the watcher wants updates once per hour";
  log->append(v1::JobEvent());
  ASSERT_EQ(source.pull(&event, false), Pull::Message);
  EXPECT_EQ(event.sequence(), 2);
  EXPECT_EQ(source.pull(&event, false), Pull::Wait) << "the work belonged to the iteration that has ended";
}

TEST(PumpConcurrency, FinishesOnceIfSeveralThreadsEndIt) {
  for (int round = 0; round < 50; ++round) {
    Streams all(2);
    std::vector<std::thread> enders;
    for (const auto& stream : all.streams)
      for (int i = 0; i < 2; ++i) enders.emplace_back([&] { stream->pump().end({}); });
    for (int i = 0; i < 20; ++i) all.log.append({});
    all.log.close();
    for (std::thread& ender : enders) ender.join();
    for (const auto& stream : all.streams) stream->wait();
  }
}

}  // namespace
}  // namespace varimesh::server::testing
