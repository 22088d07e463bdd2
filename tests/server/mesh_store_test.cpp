// Meshes by content: lifetimes, and uploads that follow each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <thread>

#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/sha256.h"
#include "server/meshes/zstd.h"

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

TEST(MeshStoreTest, AnswersWhoComesBackWhileAnUploadIsFinished) {
  const std::filesystem::path directory = std::filesystem::path(::testing::TempDir()) / "varimesh-cut";
  const auto store = std::move(*DirectoryMeshStore::open_directory(directory.string(), settings_with()));
  for (int i = 0; i < 200; ++i) {
    const std::string bytes = "mesh " + std::to_string(i), id = std::to_string(i);
    const auto size = static_cast<std::int64_t>(bytes.size());
    const auto cut = store->begin_upload(id, digest_of(bytes), size);
    ASSERT_TRUE(cut && store->append(*cut, 0, bytes));
    std::atomic<bool> finishes = false;
    std::thread finishing([&] {
      finishes = true;
      const auto finished = store->finish_upload(*cut);
      EXPECT_TRUE(finished || finished.error().code == Failure::Code::Aborted) << finished.error().sentence;
    });
    while (!finishes) std::this_thread::yield();
    if (i % 2 == 0) std::this_thread::sleep_for(std::chrono::microseconds(i));
    const auto again = store->begin_upload(id, digest_of(bytes), size);
    EXPECT_TRUE(again);
    if (again && !again->complete) {
      const auto finished = store->finish_upload(*again);
      EXPECT_TRUE(finished) << finished.error().sentence;
    }
    finishing.join();
    EXPECT_TRUE(store->query_upload(id, digest_of(bytes))->complete);
  }
  std::filesystem::remove_all(directory);
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

// ===== at rest =====

/// Bytes of which there are many, and which compress well.
std::string long_text(int lines) {
  std::string text;
  for (int i = 0; i < lines; ++i) text += std::to_string(i) + " 0.123456 " + std::to_string(i % 7) + "\n";
  return text;
}

/// A directory and a store in it that compresses what has lain for ten minutes.
class AtRest : public ::testing::Test {
 protected:
  AtRest() {
    std::string name = ::testing::TempDir() + "varimesh-rest-XXXXXX";
    directory_ = ::mkdtemp(name.data());
    open();
  }
  ~AtRest() override {
    store_.reset();
    std::filesystem::remove_all(directory_);
  }
  void open() {
    store_.reset();
    DirectoryMeshSettings settings = settings_with([this] { return now_; });
    settings.compress_after = std::chrono::minutes(10);
    settings.log = [this](const std::string& line) { lines_.push_back(line); };
    store_ = std::move(*DirectoryMeshStore::open_directory(directory_.string(), settings));
  }
  void rest() {
    now_ += std::chrono::minutes(11);
    store_->compress_idle(needed_, [] { return false; });
  }
  bool is_compressed(const std::string& digest) const {
    const bool compressed = std::filesystem::exists(directory_ / (digest + ".zst"));
    EXPECT_NE(compressed, std::filesystem::exists(directory_ / digest)) << "one of the two";
    return compressed;
  }
  std::string whole(const std::string& digest) const {
    const auto blob = store_->open(digest);
    return blob ? std::string((*blob)->bytes()) : blob.error().sentence;
  }
  std::string in_pieces(const std::string& digest, std::int64_t offset, bool zstd) const {
    const auto reader = store_->read(digest);
    if (!reader) return reader.error().sentence;
    std::string all, content;
    while (true) {
      const auto piece = (*reader)->read(offset, zstd);
      if (!piece || piece->size == 0) return piece ? all : piece.error().sentence;
      EXPECT_TRUE(zstd || !piece->is_zstd);
      offset += piece->size;
      const bool good = !piece->is_zstd || zstd_decompress(piece->bytes, 1 << 20, &content);
      EXPECT_TRUE(good);
      all += piece->is_zstd ? content : piece->bytes;
    }
  }

  Time now_ = Time(std::chrono::hours(500'000));
  std::filesystem::path directory_;
  std::unique_ptr<DirectoryMeshStore> store_;
  std::set<std::string> needed_;
  std::vector<std::string> lines_;  ///< Of its log.
};

TEST_F(AtRest, IsCompressedWhenNobodyHasAskedForItInAWhile) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  store_->compress_idle(needed_, [] { return false; });
  EXPECT_FALSE(is_compressed(stored.digest)) << "somebody may want it at once";
  rest();
  EXPECT_TRUE(is_compressed(stored.digest));
  EXPECT_LT(std::filesystem::file_size(directory_ / (stored.digest + ".zst")), bytes.size() / 2);
  EXPECT_EQ(whole(stored.digest), bytes);
  for (const bool zstd : {false, true})
    for (const std::int64_t offset : {0, 1, 256 * 1024, 300'000, 524'287})
      EXPECT_EQ(in_pieces(stored.digest, offset, zstd), bytes.substr(static_cast<std::size_t>(offset)));
  EXPECT_EQ(in_pieces(stored.digest, stored.size, false), "");
  EXPECT_EQ(write(*store_, bytes).digest, stored.digest) << "the same bytes once more";
  EXPECT_TRUE(is_compressed(stored.digest));
}

TEST_F(AtRest, StaysReadableForWhoHasItOpen) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  const auto blob = *store_->open(stored.digest);
  const auto reader = std::move(*store_->read(stored.digest));
  rest();
  ASSERT_TRUE(is_compressed(stored.digest));
  EXPECT_EQ(blob->bytes(), bytes);
  EXPECT_EQ(reader->read(0, false)->bytes, bytes.substr(0, 256 * 1024));
}

TEST_F(AtRest, IsAsItWasAfterARestart) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  rest();
  // As where the process ended before it could remove the plain file.
  std::ofstream(directory_ / stored.digest) << bytes;
  open();
  EXPECT_TRUE(is_compressed(stored.digest));
  EXPECT_EQ(whole(stored.digest), bytes);
  EXPECT_TRUE(store_->query_upload("", stored.digest)->complete);
  EXPECT_EQ(store_->query_upload("", stored.digest)->committed, stored.size);
  store_->retain(stored.digest);
  now_ += std::chrono::hours(25);
  store_->sweep();
  EXPECT_EQ(whole(stored.digest), bytes) << "something refers to it";
  store_->release(stored.digest);
  now_ += std::chrono::hours(25);
  store_->sweep();
  EXPECT_TRUE(std::filesystem::is_empty(directory_));
}

TEST_F(AtRest, GoesWithItsLastReference) {
  const StoredBytes stored = write(*store_, long_text(50'000));
  rest();
  ASSERT_TRUE(is_compressed(stored.digest));
  store_->release(stored.digest);
  EXPECT_TRUE(std::filesystem::is_empty(directory_));
}

TEST_F(AtRest, IsLeftWhereItDoesNotShrinkOrIsSmall) {
  std::string noise(1'000'000, '\0');
  std::uint32_t state = 1;
  for (char& c : noise) c = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
  const StoredBytes dense = write(*store_, noise), small = write(*store_, long_text(100));
  rest();
  EXPECT_FALSE(is_compressed(dense.digest));
  EXPECT_FALSE(is_compressed(small.digest));
  EXPECT_EQ(whole(dense.digest), noise);
}

TEST_F(AtRest, IsLeftWhereAJobNeedsItSoon) {
  const StoredBytes stored = write(*store_, long_text(50'000)), other = write(*store_, long_text(50'001));
  needed_ = {stored.digest};
  rest();
  EXPECT_FALSE(is_compressed(stored.digest));
  EXPECT_TRUE(is_compressed(other.digest));
  needed_.clear();
  rest();
  EXPECT_TRUE(is_compressed(stored.digest));
}

TEST_F(AtRest, GoesOnBeyondWhatCannotBeRead) {
  std::vector<StoredBytes> all;
  for (int i = 0; i < 4; ++i) all.push_back(write(*store_, long_text(50'000 + i)));
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.digest < b.digest; });
  ASSERT_TRUE(store_->pin(all[0].digest));
  store_->release(all[0].digest);
  for (int i = 0; i < 3; ++i) std::filesystem::remove(directory_ / all[i].digest);
  std::filesystem::create_symlink(all[2].digest, directory_ / all[2].digest);  // to itself: nobody can open it
  rest();
  EXPECT_TRUE(is_compressed(all[3].digest));
  EXPECT_EQ(lines_.size(), 3u);
  EXPECT_FALSE(store_->query_upload("", all[0].digest)) << "it has gone, and may be uploaded again";
  rest();
  EXPECT_EQ(lines_.size(), 3u) << "once is enough";
}

TEST_F(AtRest, IsGivenUpWithoutATrace) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  now_ += std::chrono::minutes(11);
  int asked = 0;
  store_->compress_idle(needed_, [&] { return ++asked > 3; });
  EXPECT_FALSE(is_compressed(stored.digest));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_), {}), 1);
  EXPECT_EQ(whole(stored.digest), bytes);
}

TEST_F(AtRest, SaysWhereItIsDamaged) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  rest();
  const std::filesystem::path path = directory_ / (stored.digest + ".zst");
  {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(5000);
    file << "damage";
  }
  EXPECT_FALSE(store_->open(stored.digest));
  const auto reader = store_->read(stored.digest);
  ASSERT_TRUE(reader);
  EXPECT_FALSE((*reader)->read(0, false));
  std::filesystem::resize_file(path, 1000);
  EXPECT_FALSE(store_->read(stored.digest)) << "its table is gone";
}

}  // namespace
}  // namespace varimesh::server
