// Meshes by content: lifetimes, and uploads that follow each other.
#include <gtest/gtest.h>

#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/sha256.h"

namespace varimesh::server {
namespace {

std::string digest_of(const std::string& bytes) {
  Sha256 hash;
  hash.update(bytes);
  return hash.finish();
}

std::unique_ptr<DirectoryMeshStore> new_store(DirectoryMeshStore::Clock clock = std::chrono::steady_clock::now) {
  return std::move(*DirectoryMeshStore::create(::testing::TempDir(), 1000, std::move(clock)));
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
  std::chrono::steady_clock::time_point now{};
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
    const auto store = std::move(*DirectoryMeshStore::create(parent.string(), 1000));
    write(*store, "result");
    ASSERT_TRUE(store->begin_upload("id", digest_of("abc"), 3));
  }
  EXPECT_TRUE(std::filesystem::is_empty(parent));
  std::filesystem::remove(parent);
}

}  // namespace
}  // namespace varimesh::server
