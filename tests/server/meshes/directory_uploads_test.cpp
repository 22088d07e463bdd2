// Uploads into the store: streams that follow each other, and uploads that nobody continues.
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <iterator>
#include <limits>
#include <thread>

#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {
namespace {

TEST(DirectoryUploads, CanBeTakenOverByALaterStream) {
  const auto store = new_store();
  const auto first = store->begin_upload("id", sha256("abcdef"), 6);
  ASSERT_TRUE(first);
  ASSERT_TRUE(store->append(*first, 0, "abc"));
  const auto second = store->begin_upload("id", sha256("abcdef"), 6);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->committed, 3);
  EXPECT_EQ(store->append(*first, 3, "def").error().code, Failure::Code::Aborted);
  EXPECT_EQ(store->append(*second, 2, "cdef").error().reason, "WRONG_OFFSET");
  ASSERT_TRUE(store->append(*second, 3, "def"));
  EXPECT_TRUE(store->finish_upload(*second));
}

TEST(DirectoryUploads, AreDroppedAfterTenIdleMinutes) {
  Time now{};
  const auto store = new_store([&] { return now; });
  ASSERT_TRUE(store->begin_upload("old", sha256("abc"), 3));
  now += std::chrono::minutes(11);
  ASSERT_TRUE(store->begin_upload("new", sha256("def"), 3));
  EXPECT_FALSE(store->query_upload("old", ""));
  EXPECT_TRUE(store->query_upload("new", ""));
}

TEST(DirectoryUploads, TakeNothingFromAStreamOfAnEarlierUploadWithTheSameId) {
  Time now{};
  const auto store = new_store([&] { return now; });
  const auto old = store->begin_upload("id", sha256("abc"), 3);
  now += std::chrono::minutes(11);
  store->sweep();
  const auto other = store->begin_upload("id", sha256("defg"), 4);
  ASSERT_TRUE(old && other);
  EXPECT_EQ(store->append(*old, 0, "abc").error().code, Failure::Code::Aborted);
  EXPECT_EQ(store->finish_upload(*old).error().code, Failure::Code::Aborted);
  ASSERT_TRUE(store->append(*other, 0, "defg"));
  EXPECT_TRUE(store->finish_upload(*other));
}

/// How many descriptors this process has open.
std::ptrdiff_t open_descriptors() { return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {}); }

TEST(DirectoryUploads, HoldNoDescriptorWhileTheyRest) {
  const auto store = new_store();
  const auto before = open_descriptors();
  for (int i = 0; i < 100; ++i) {
    const auto ticket = store->begin_upload(std::to_string(i), sha256("abcdef"), 6);
    ASSERT_TRUE(ticket);
    ASSERT_TRUE(store->append(*ticket, 0, "abc"));
  }
  EXPECT_EQ(open_descriptors(), before);
  for (int i = 0; i < 2; ++i) {
    const auto ticket = store->begin_upload(std::to_string(i), sha256("abcdef"), 6);
    ASSERT_TRUE(ticket);
    if (ticket->complete) continue;
    ASSERT_TRUE(store->append(*ticket, 3, "def"));
    ASSERT_TRUE(store->finish_upload(*ticket));
  }
  EXPECT_EQ((*store->open(sha256("abcdef")))->bytes(), "abcdef");
}

TEST(DirectoryUploads, CannotTakeTheReserveTogether) {
  DirectoryMeshSettings settings = settings_with();
  settings.max_mesh_bytes = std::numeric_limits<std::int64_t>::max();
  const auto free = static_cast<std::int64_t>(std::filesystem::space(::testing::TempDir()).available);
  settings.reserve_bytes = free / 4;
  const auto store = std::move(*DirectoryMeshStore::create(::testing::TempDir(), settings));
  const std::int64_t half = free / 2;
  const auto first = store->begin_upload("1", sha256("1"), half);
  ASSERT_TRUE(first) << "a half and the reserve fit";
  EXPECT_EQ(store->begin_upload("2", sha256("2"), half).error().reason, "STORE_FULL");
  EXPECT_EQ(store->create(half).error().reason, "STORE_FULL");
  EXPECT_TRUE(store->begin_upload("1", sha256("1"), half)) << "its own room is kept for it";
  EXPECT_TRUE(store->create()) << "a result may use the reserve";
  EXPECT_TRUE(store->has_room()) << "what is only announced does not stop the server";
  ASSERT_FALSE(store->append(*first, 0, "x")) << "the second stream has taken the upload over";
  const auto again = store->begin_upload("1", sha256("1"), half);
  ASSERT_TRUE(store->append(*again, 0, "x"));
  {
    auto writer = store->create(free / 8);
    ASSERT_TRUE(writer);
    EXPECT_EQ(store->begin_upload("3", sha256("3"), free / 6).error().reason, "STORE_FULL");
  }
  EXPECT_TRUE(store->begin_upload("3", sha256("3"), free / 6)) << "the writer has given its room back";
}

TEST(DirectoryUploads, TakeNoRoomFromOthersOnceTheyAreCut) {
  DirectoryMeshSettings settings = settings_with();
  settings.max_mesh_bytes = std::numeric_limits<std::int64_t>::max();
  const auto free = static_cast<std::int64_t>(std::filesystem::space(::testing::TempDir()).available);
  settings.reserve_bytes = free / 4;
  const auto store = std::move(*DirectoryMeshStore::create(::testing::TempDir(), settings));
  {
    const auto first = store->begin_upload("1", sha256("1"), free / 2);
    ASSERT_TRUE(first && store->append(*first, 0, "x"));
    EXPECT_EQ(store->begin_upload("2", sha256("2"), free / 2).error().reason, "STORE_FULL");
  }
  const auto second = store->begin_upload("2", sha256("2"), free / 2);
  EXPECT_TRUE(second) << "the stream of the first has ended";
  EXPECT_EQ(store->begin_upload("1", sha256("1"), free / 2).error().reason, "STORE_FULL") << "its room is gone";
  EXPECT_EQ(store->query_upload("1", sha256("1"))->committed, 1) << "it may go on later";
}

TEST(DirectoryUploads, AcceptASecondStreamWhileTheFirstFinishes) {
  const std::filesystem::path directory = std::filesystem::path(::testing::TempDir()) / "varimesh-cut";
  const auto store = std::move(*DirectoryMeshStore::open_directory(directory.string(), settings_with()));
  for (int i = 0; i < 200; ++i) {
    const std::string bytes = "mesh " + std::to_string(i), id = std::to_string(i);
    const auto size = static_cast<std::int64_t>(bytes.size());
    const auto cut = store->begin_upload(id, sha256(bytes), size);
    ASSERT_TRUE(cut && store->append(*cut, 0, bytes));
    std::atomic<bool> finishes = false;
    std::thread finishing([&] {
      finishes = true;
      const auto finished = store->finish_upload(*cut);
      EXPECT_TRUE(finished || finished.error().code == Failure::Code::Aborted) << finished.error().sentence;
    });
    while (!finishes) std::this_thread::yield();
    if (i % 2 == 0) std::this_thread::sleep_for(std::chrono::microseconds(i));
    const auto again = store->begin_upload(id, sha256(bytes), size);
    EXPECT_TRUE(again);
    if (again && !again->complete) {
      const auto finished = store->finish_upload(*again);
      EXPECT_TRUE(finished) << finished.error().sentence;
    }
    finishing.join();
    EXPECT_TRUE(store->query_upload(id, sha256(bytes))->complete);
  }
  std::filesystem::remove_all(directory);
}

}  // namespace
}  // namespace varimesh::server::testing
