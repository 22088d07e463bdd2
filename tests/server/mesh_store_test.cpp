// Meshes by content: lifetimes, and uploads that follow each other.
#include <gtest/gtest.h>

#include <fstream>

#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/sha256.h"

namespace varimesh::server {
namespace {

std::string digest_of(const std::string& bytes) {
  Sha256 hash;
  hash.update(bytes);
  return hash.finish();
}

using Time = std::chrono::system_clock::time_point;

DirectoryMeshSettings settings_with(std::function<Time()> clock = std::chrono::system_clock::now) {
  DirectoryMeshSettings settings;
  settings.max_mesh_bytes = 1000;
  settings.lifetime = std::chrono::hours(24);
  settings.clock = std::move(clock);
  return settings;
}

std::unique_ptr<DirectoryMeshStore> new_store(std::function<Time()> clock = std::chrono::system_clock::now) {
  return std::move(*DirectoryMeshStore::create(::testing::TempDir(), settings_with(std::move(clock))));
}

StoredBytes write(MeshStore& store, const std::string& bytes) {
  auto writer = std::move(*store.create());
  EXPECT_TRUE(writer->append(bytes));
  return *writer->commit();
}

TEST(Sha256Test, AgreesWithTheStandardsExample) {
  // FIPS 180-4, the example of "abc".
  EXPECT_EQ(digest_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(MeshStoreTest, DropsAResultWithItsLastReference) {
  const auto store = new_store();
  const StoredBytes first = write(*store, "result"), second = write(*store, "result");
  EXPECT_EQ(first.digest, second.digest);
  store->release(first.digest);
  ASSERT_TRUE(store->open(first.digest));
  EXPECT_EQ((*store->open(first.digest))->bytes(), "result");
  store->release(first.digest);
  EXPECT_FALSE(store->open(first.digest));
}

TEST(MeshStoreTest, KeepsAResultThatSomebodyWasToldIsThere) {
  const auto store = new_store();
  const StoredBytes stored = write(*store, "result");
  ASSERT_TRUE(store->pin(stored.digest));
  store->release(stored.digest);
  EXPECT_TRUE(store->open(stored.digest));
}

TEST(MeshStoreTest, LetsALaterStreamTakeAnUploadOver) {
  const auto store = new_store();
  const auto first = store->begin_upload("id", digest_of("abcdef"), 6);
  ASSERT_TRUE(first);
  ASSERT_TRUE(store->append(*first, 0, "abc"));
  const auto second = store->begin_upload("id", digest_of("abcdef"), 6);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->committed, 3);
  EXPECT_EQ(store->append(*first, 3, "def").error().code, Failure::Code::Aborted);
  EXPECT_EQ(store->append(*second, 2, "cdef").error().reason, "WRONG_OFFSET");
  ASSERT_TRUE(store->append(*second, 3, "def"));
  EXPECT_TRUE(store->finish_upload(*second));
}

TEST(MeshStoreTest, DropsAnUploadThatNobodyTouches) {
  Time now{};
  const auto store = new_store([&] { return now; });
  ASSERT_TRUE(store->begin_upload("old", digest_of("abc"), 3));
  now += std::chrono::minutes(11);
  ASSERT_TRUE(store->begin_upload("new", digest_of("def"), 3));
  EXPECT_FALSE(store->query_upload("old", ""));
  EXPECT_TRUE(store->query_upload("new", ""));
}

TEST(MeshStoreTest, LeavesNothingBehind) {
  std::filesystem::path parent = std::filesystem::path(::testing::TempDir()) / "varimesh-empty";
  std::filesystem::create_directories(parent);
  {
    const auto store = std::move(*DirectoryMeshStore::create(parent.string(), settings_with()));
    write(*store, "result");
    ASSERT_TRUE(store->begin_upload("id", digest_of("abc"), 3));
  }
  EXPECT_TRUE(std::filesystem::is_empty(parent));
  std::filesystem::remove(parent);
}

TEST(MeshStoreTest, SweepsWhatIsOldAndNothingRefersTo) {
  Time now = std::chrono::system_clock::now();
  const auto store = new_store([&] { return now; });
  const StoredBytes pinned = write(*store, "pinned"), referred = write(*store, "referred");
  ASSERT_TRUE(store->pin(pinned.digest));
  store->release(pinned.digest);
  now += std::chrono::hours(20);
  store->sweep();
  ASSERT_TRUE(store->pin(pinned.digest)) << "asked for again";
  now += std::chrono::hours(20);
  store->sweep();
  EXPECT_TRUE(store->open(pinned.digest));
  now += std::chrono::hours(23);
  store->sweep();
  EXPECT_TRUE(store->open(pinned.digest)) << "read 23 hours ago";
  now += std::chrono::hours(24);
  store->sweep();
  EXPECT_FALSE(store->open(pinned.digest));
  EXPECT_TRUE(store->open(referred.digest));
}

TEST(MeshStoreTest, SweepsTheOldestBeyondItsSize) {
  Time now = std::chrono::system_clock::now();
  DirectoryMeshSettings settings = settings_with([&] { return now; });
  settings.max_total_bytes = 25;
  const auto store = std::move(*DirectoryMeshStore::create(::testing::TempDir(), settings));
  std::vector<std::string> digests;
  for (const char* bytes : {"ten bytes 1", "ten bytes 2", "ten bytes 3", "ten bytes 4"}) {
    digests.push_back(write(*store, bytes).digest);
    store->pin(digests.back());
    if (digests.size() != 1) store->release(digests.back());
    now += std::chrono::minutes(15);
  }
  store->sweep();
  EXPECT_TRUE(store->open(digests[0])) << "the oldest, but something refers to it";
  EXPECT_FALSE(store->open(digests[1]));
  EXPECT_FALSE(store->open(digests[2]));
  EXPECT_TRUE(store->open(digests[3]));
}

TEST(MeshStoreTest, GoesOnWithWhatIsInItsDirectory) {
  const std::filesystem::path directory = std::filesystem::path(::testing::TempDir()) / "varimesh-kept";
  Time now = std::chrono::system_clock::now();
  std::string digest, result;
  const auto open = [&] {
    return std::move(*DirectoryMeshStore::open_directory(directory.string(), settings_with([&] { return now; })));
  };
  {
    const auto store = open();
    digest = write(*store, "a mesh").digest;
    result = write(*store, "a result").digest;
    ASSERT_TRUE(store->begin_upload("broken", digest_of("abc"), 3));
  }
  std::ofstream(directory / "part-77") << "of a writer that was killed";
  now += std::chrono::hours(48);
  {
    const auto store = open();
    store->retain(result);
    ASSERT_TRUE(store->open(result));
    EXPECT_EQ((*store->open(result))->bytes(), "a result");
    store->sweep();
    // Looked for in the directory, since open() makes a mesh young again.
    EXPECT_TRUE(std::filesystem::exists(directory / digest))
        << "whoever was told that it is there has an hour to use it";
    now += std::chrono::hours(2);
    store->sweep();
    EXPECT_FALSE(store->open(digest));
    ASSERT_TRUE(store->open(result));
    store->release(result);
  }
  EXPECT_TRUE(std::filesystem::is_empty(directory));
  std::filesystem::remove(directory);
}

}  // namespace
}  // namespace varimesh::server
