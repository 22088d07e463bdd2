// The order of a job's events, skipped iterations, and the end.
#include "server/jobs/event_log.h"

#include <gtest/gtest.h>

#include "server/jobs/timestamps.h"

namespace varimesh::server {
namespace {

v1::JobEvent iteration(int number, std::chrono::milliseconds at = {}) {
  v1::JobEvent event;
  event.mutable_iteration()->set_number(number);
  *event.mutable_time() = timestamp(std::chrono::system_clock::time_point(at));
  return event;
}

v1::JobEvent state(v1::JobState state) {
  v1::JobEvent event;
  event.mutable_state_change()->set_state(state);
  return event;
}

/// Returns everything that a watcher gets now if it continues after number `after`.
std::vector<v1::JobEvent> read(const EventLog& log, std::int64_t after, std::chrono::nanoseconds interval = {}) {
  std::vector<v1::JobEvent> events;
  v1::JobEvent event;
  std::chrono::system_clock::time_point last{};
  while (log.next(after, interval, last, &event) == EventLog::Next::Event) {
    after = event.sequence();
    if (event.has_iteration()) last = time_point(event.time());
    events.push_back(event);
  }
  return events;
}

TEST(EventLog, KeepsTheNewestMeshForThoseWhoWatchIt) {
  EventLog log;
  EXPECT_FALSE(log.is_mesh_watched());
  EXPECT_EQ(log.watch_mesh(), nullptr);
  EXPECT_TRUE(log.is_mesh_watched());
  for (const char* const bytes : {"first", "second"}) {
    log.show_mesh(std::make_shared<const std::string>(bytes));
    EXPECT_EQ(*log.watch_mesh(), bytes);
  }
  log.show_mesh(nullptr);
  EXPECT_EQ(log.watch_mesh(), nullptr) << "the attempt has ended";
  log.show_mesh(std::make_shared<const std::string>("third"));
  log.close();
  EXPECT_EQ(log.watch_mesh(), nullptr);
  EXPECT_FALSE(log.is_mesh_watched()) << "the job has ended";
  log.show_mesh(std::make_shared<const std::string>("late"));
  EXPECT_EQ(log.watch_mesh(), nullptr);
}

TEST(EventLog, CountsTheIterationsThatItSkips) {
  EventLog log({4096, 10});
  log.append(state(v1::JOB_STATE_RUNNING));
  for (int i = 1; i <= 100; ++i) log.append(iteration(i));
  log.append(state(v1::JOB_STATE_SUCCEEDED));
  const auto events = read(log, 0);
  std::int64_t delivered = 0, thinned = 0;
  for (const auto& event : events) {
    ++delivered;
    thinned += event.thinned();
  }
  EXPECT_GT(thinned, 0);
  EXPECT_EQ(delivered + thinned, log.last_sequence());
  EXPECT_EQ(events.front().state_change().state(), v1::JOB_STATE_RUNNING);
  EXPECT_EQ(events.back().state_change().state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(EventLog, DeliversIterationsAtTheRequestedInterval) {
  EventLog log;
  for (int i = 1; i <= 100; ++i) log.append(iteration(i, std::chrono::milliseconds(1000 + i)));
  const auto events = read(log, 0, std::chrono::milliseconds(10));
  EXPECT_EQ(events.size(), 10u);
}

TEST(EventLog, KeepsAllStatesWhenItDropsIterations) {
  EventLog log({5, 1000});
  log.append(state(v1::JOB_STATE_PENDING));
  log.append(state(v1::JOB_STATE_RUNNING));
  for (int i = 1; i <= 20; ++i) log.append(iteration(i));
  const auto events = read(log, 0);
  ASSERT_EQ(events.size(), 7u);
  EXPECT_EQ(events[2].thinned(), 15);
  EXPECT_TRUE(log.can_resume_after(0));
  EXPECT_FALSE(log.can_resume_after(10)) << "dropped";
  EXPECT_TRUE(log.can_resume_after(17));
  EXPECT_FALSE(log.can_resume_after(23)) << "never given";
}

TEST(EventLog, EndsAfterItIsClosedAndRead) {
  EventLog log;
  log.append(state(v1::JOB_STATE_SUCCEEDED));
  v1::JobEvent event;
  EXPECT_EQ(log.next(1, {}, {}, &event), EventLog::Next::Wait);
  log.close();
  EXPECT_EQ(log.next(0, {}, {}, &event), EventLog::Next::Event);
  EXPECT_EQ(log.next(1, {}, {}, &event), EventLog::Next::End);
}

}  // namespace
}  // namespace varimesh::server
