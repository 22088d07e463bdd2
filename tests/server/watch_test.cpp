// The guarantees of a watch, over real connections that are cut.
#include <random>

#include "tests/server/harness.h"
#include "tests/server/watch_guarantees.h"

namespace varimesh::server::testing {
namespace {

/// Watches a job to its end in streams that are cut after some events.
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

TEST(Watch, KeepsItsGuaranteesOverAThousandCuts) {
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

TEST(WatchGuarantees, AreFoundBrokenWhereTheyAre) {
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
  EXPECT_NE(broken_resumption({{0, {event(1), event(3)}}}), "") << "a gap that nobody counted";
  EXPECT_EQ(broken_resumption({{0, {event(1), event(3, 1)}}}), "");
  EXPECT_EQ(broken_resumption({{0, {event(1), event(kSequenceBlock + 1)}}}), "") << "a server was lost in between";
}

}  // namespace
}  // namespace varimesh::server::testing
