// WatchJob: events, bookmarks, and the guarantees of a watch over connections that are cut.
#include <random>

#include "tests/server/service.h"
#include "tests/server/watch_guarantees.h"

namespace varimesh::server::testing {
namespace {

TEST(WatchJob, DeliversEveryEventOnceAndInOrder) {
  const Service service(echo_engine(50));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  const auto events = service.watch(job.name());
  // PENDING, RUNNING, 50 iterations, two quality reports, SUCCEEDED
  ASSERT_EQ(events.size(), 55u);
  for (std::size_t i = 0; i < events.size(); ++i) EXPECT_EQ(events[i].sequence(), static_cast<std::int64_t>(i) + 1);
  EXPECT_EQ(events.front().state_change().state(), v1::JOB_STATE_PENDING);
  EXPECT_EQ(events.back().state_change().state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(WatchJob, ResumesAfterACutWithoutAGap) {
  Gate gate;
  const Service service(echo_engine(60, [&](int i) {
    if (i == 30) gate.wait();
  }));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  const auto before = service.watch(job.name(), 0, 20);
  ASSERT_EQ(before.size(), 20u);
  gate.open();
  const auto after = service.watch(job.name(), before.back().sequence());
  ASSERT_FALSE(after.empty());
  std::int64_t expected = before.back().sequence();
  for (const v1::JobEvent& event : after) {
    EXPECT_EQ(event.sequence(), ++expected);
    EXPECT_EQ(event.thinned(), 0);
  }
  EXPECT_EQ(after.back().state_change().state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(WatchJob, RefusesANumberThatWasNeverGiven) {
  const Service service(echo_engine());
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  service.wait_for(job.name());
  grpc::Status status;
  EXPECT_TRUE(service.watch(job.name(), 1000, 10, &status).empty());
  EXPECT_EQ(status.error_code(), grpc::StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(info_of(status).reason(), "SEQUENCE_EXPIRED");
  google::rpc::Status full;
  ASSERT_TRUE(full.ParseFromString(status.error_details()));
  v1::Job current;
  bool found = false;
  for (const auto& detail : full.details()) found = found || detail.UnpackTo(&current);
  EXPECT_TRUE(found);
  EXPECT_EQ(current.name(), job.name());
}

TEST(WatchJob, RefusesAnIntervalThatMakesNoSense) {
  const Service service(echo_engine());
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  const auto watch = [&](std::int64_t seconds, std::int32_t nanos) {
    grpc::ClientContext context;
    v1::WatchJobRequest request;
    request.set_name(job.name());
    request.mutable_min_interval()->set_seconds(seconds);
    request.mutable_min_interval()->set_nanos(nanos);
    const auto stream = service.jobs->WatchJob(&context, request);
    v1::WatchJobResponse response;
    while (stream->Read(&response)) {
    }
    return stream->Finish().error_code();
  };
  EXPECT_EQ(watch(3600, 0), grpc::StatusCode::OK);
  for (const auto& [seconds, nanos] : {std::pair<std::int64_t, std::int32_t>{-1, 0},
                                       {3601, 0},
                                       {std::numeric_limits<std::int64_t>::max(), 0},
                                       {0, -1},
                                       {0, 1'000'000'000}})
    EXPECT_EQ(watch(seconds, nanos), grpc::StatusCode::INVALID_ARGUMENT) << seconds << " s " << nanos << " ns";
}

TEST(WatchJob, SendsABookmarkIfNothingHappens) {
  Gate gate;
  ServerOptions options = options_with(echo_engine(1, [&](int) { gate.wait(); }));
  options.limits.bookmark_interval = std::chrono::milliseconds(50);
  const Service service(std::move(options));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  const auto events = service.watch(job.name(), 0, 3);
  gate.open();
  ASSERT_EQ(events.size(), 3u);
  EXPECT_TRUE(events[2].has_bookmark());
  EXPECT_EQ(events[2].sequence(), events[1].sequence());
}

/// Watches a job to its end, in streams that are each cut after some events.
WatchHistory watch_in_pieces(const Service& service, const std::string& job, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<std::size_t> some(1, 18);
  WatchHistory history(1);
  while (true) {
    WatchedStream& stream = history.back();
    const std::size_t most = some(random);
    grpc::Status ended;
    stream.events = service.watch(job, stream.after_sequence, most, &ended);
    if (ended.ok()) return history;
    if (ended.error_code() != grpc::StatusCode::CANCELLED) {
      ADD_FAILURE() << ended.error_message();
      return history;
    }
    history.push_back({stream.events.back().sequence(), {}});
  }
}

TEST(WatchJob, KeepsItsGuaranteesOverAThousandCuts) {
  const Service service(echo_engine(1000));
  const std::string job = service.submit(service.spec_for("a mesh")).name();
  std::vector<WatchHistory> histories(10);
  std::vector<std::thread> watchers;
  for (std::size_t i = 0; i < histories.size(); ++i)
    watchers.emplace_back([&, i] { histories[i] = watch_in_pieces(service, job, static_cast<unsigned>(i)); });
  for (std::thread& watcher : watchers) watcher.join();
  const std::vector<v1::JobEvent> truth = service.watch(job);
  std::size_t cuts = 0;
  for (const WatchHistory& history : histories) {
    cuts += history.size() - 1;
    EXPECT_EQ(broken_order(history), "");
    EXPECT_EQ(broken_uniqueness(history), "");
    EXPECT_EQ(broken_reliability(history, truth), "");
    EXPECT_EQ(broken_resumption(history), "");
    EXPECT_EQ(broken_bookmarks(history, 15), "");
  }
  EXPECT_GE(cuts, 1000u);
}

TEST(WatchGuarantees, AreReportedIfTheyAreBroken) {
  const auto event = [](std::int64_t sequence, std::int64_t thinned = 0) {
    v1::JobEvent event;
    event.set_sequence(sequence);
    event.set_thinned(thinned);
    event.mutable_time()->set_seconds(sequence * 10);
    event.mutable_state_change();
    return event;
  };
  const std::vector<v1::JobEvent> truth{event(1), event(2), event(3)};
  const WatchHistory good{{0, {event(1)}}, {1, {event(2), event(3)}}};
  EXPECT_EQ(broken_order(good) + broken_uniqueness(good) + broken_reliability(good, truth) + broken_resumption(good),
            "");
  EXPECT_EQ(broken_bookmarks(good, 10), "");
  EXPECT_NE(broken_bookmarks(good, 9), "");
  EXPECT_NE(broken_order({{0, {event(2), event(1)}}}), "");
  EXPECT_NE(broken_uniqueness({{0, {event(1)}}, {0, {event(1)}}}), "");
  EXPECT_NE(broken_reliability({{0, {event(1), event(3)}}}, truth), "");
  EXPECT_NE(broken_reliability({{0, {event(1), event(2), event(3)}}}, {event(1), event(2), v1::JobEvent(event(4))}),
            "");
  EXPECT_NE(broken_resumption({{0, {event(1)}}, {2, {event(3)}}}), "");
  EXPECT_NE(broken_resumption({{0, {event(1), event(3)}}}), "") << "a gap that was not counted";
  EXPECT_EQ(broken_resumption({{0, {event(1), event(3, 1)}}}), "");
  EXPECT_EQ(broken_resumption({{0, {event(1), event(kSequenceRange + 1)}}}), "") << "a server was lost in between";
}

}  // namespace
}  // namespace varimesh::server::testing
