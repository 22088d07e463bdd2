// Uploads into the store: streams that follow each other, and uploads that nobody continues.
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
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
