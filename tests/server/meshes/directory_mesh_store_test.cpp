// Meshes by content: references, lifetimes and restarts.
#include "server/meshes/directory_mesh_store.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {
namespace {

/// Bytes that this process has read from files so far.
std::int64_t bytes_read() {
  std::ifstream io("/proc/self/io");
  std::string name;
  std::int64_t bytes = -1;
  io >> name >> bytes;
  return name == "rchar:" ? bytes : -1;
}

class ComparedFile : public ::testing::Test {
 protected:
  static constexpr std::int64_t kSize = std::int64_t{9} << 20, kLittle = std::int64_t{1} << 20;

  ComparedFile() {
    std::string name = ::testing::TempDir() + "varimesh-compared-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    store_ = std::move(*DirectoryMeshStore::open_directory(folder_.string(), settings_with()));
    digest_ = write(*store_, std::string(kSize, 'm')).digest;
    // As if it had been written a while ago: otherwise a change in the same moment would have the same time.
    std::filesystem::last_write_time(folder_ / digest_,
                                     std::filesystem::file_time_type::clock::now() - std::chrono::minutes(1));
  }
  ~ComparedFile() override { std::filesystem::remove_all(folder_); }

  /// How many bytes it takes to open a reader of the mesh.
  std::int64_t cost() {
    const std::int64_t before = bytes_read();
    EXPECT_TRUE(store_->read(digest_));
    return bytes_read() - before;
  }

  std::filesystem::path folder_;
  std::unique_ptr<DirectoryMeshStore> store_;
  std::string digest_;
};

TEST_F(ComparedFile, IsNotComparedAgain) {
  EXPECT_GE(cost(), kSize);
  EXPECT_LT(cost(), kLittle);
}

TEST_F(ComparedFile, IsComparedAgainAfterAChange) {
  EXPECT_GE(cost(), kSize);
  std::fstream(folder_ / digest_, std::ios::in | std::ios::out).seekp(kSize / 2).put('x');
  const auto reader = store_->read(digest_);
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error().code, Failure::Code::DataLoss);
}

TEST_F(ComparedFile, CanBeComparedInSteps) {
  const auto check = store_->check(digest_);
  ASSERT_NE(check, nullptr);
  const std::int64_t before = bytes_read();
  EXPECT_TRUE(check->step());
  EXPECT_LT(bytes_read() - before, kSize / 2 + kLittle);
  EXPECT_TRUE(check->step());
  EXPECT_FALSE(check->step());
  EXPECT_LT(cost(), kLittle);
  EXPECT_EQ(store_->check(digest_), nullptr) << "there is nothing left to do";
}

TEST(DirectoryMeshStore, DropsAResultWithItsLastReference) {
  const auto store = new_store();
  const StoredBytes first = write(*store, "result"), second = write(*store, "result");
  EXPECT_EQ(first.digest, second.digest);
  store->release(first.digest);
  ASSERT_TRUE(store->open(first.digest));
  EXPECT_EQ((*store->open(first.digest))->bytes(), "result");
  store->release(first.digest);
  EXPECT_FALSE(store->open(first.digest));
}

TEST(DirectoryMeshStore, KeepsAPinnedResultWithoutReferences) {
  const auto store = new_store();
  const StoredBytes stored = write(*store, "result");
  ASSERT_TRUE(store->pin(stored.digest));
  store->release(stored.digest);
  EXPECT_TRUE(store->open(stored.digest));
}

TEST(DirectoryMeshStore, DeletesAMeshOnlyIfNobodyRefersToIt) {
  const auto store = new_store();
  const std::string digest = write(*store, "result").digest;
  EXPECT_EQ(store->remove(digest).error().reason, "MESH_IN_USE");
  ASSERT_TRUE(store->pin(digest));
  store->release(digest);
  EXPECT_TRUE(store->remove(digest));
  EXPECT_FALSE(store->open(digest));
  EXPECT_EQ(store->remove(digest).error().code, Failure::Code::NotFound);
}

TEST(DirectoryMeshStore, KeepsNoMeshForHavingBeenTouched) {
  const auto store = new_store();
  const std::string digest = write(*store, "result").digest;
  EXPECT_TRUE(store->touch(digest));
  store->release(digest);
  EXPECT_FALSE(store->touch(digest));
}

TEST(DirectoryMeshStore, DeletesItsTemporaryDirectory) {
  std::filesystem::path parent = std::filesystem::path(::testing::TempDir()) / "varimesh-empty";
  std::filesystem::create_directories(parent);
  {
    const auto store = std::move(*DirectoryMeshStore::create(parent.string(), settings_with()));
    write(*store, "result");
    ASSERT_TRUE(store->begin_upload("id", sha256("abc"), 3));
  }
  EXPECT_TRUE(std::filesystem::is_empty(parent));
  std::filesystem::remove(parent);
}

TEST(DirectoryMeshStore, SweepsOldMeshesWithoutReferences) {
  Time now = std::chrono::steady_clock::now();
  const auto store = new_store([&] { return now; });
  const StoredBytes pinned = write(*store, "pinned"), referred = write(*store, "referred");
  ASSERT_TRUE(store->pin(pinned.digest));
  store->release(pinned.digest);
  now += std::chrono::hours(20);
  store->sweep();
  ASSERT_TRUE(store->pin(pinned.digest)) << "it is used again";
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

TEST(DirectoryMeshStore, SweepsTheOldestMeshesIfItIsTooLarge) {
  Time now = std::chrono::steady_clock::now();
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
  EXPECT_TRUE(store->open(digests[0])) << "the oldest, but it has a reference";
  EXPECT_FALSE(store->open(digests[1]));
  EXPECT_FALSE(store->open(digests[2]));
  EXPECT_TRUE(store->open(digests[3]));
}

TEST(DirectoryMeshStore, HasTheSameMeshesAfterARestart) {
  const std::filesystem::path directory = std::filesystem::path(::testing::TempDir()) / "varimesh-kept";
  Time now = std::chrono::steady_clock::now();
  std::string digest, result;
  const auto open = [&] {
    return std::move(*DirectoryMeshStore::open_directory(directory.string(), settings_with([&] { return now; })));
  };
  {
    const auto store = open();
    digest = write(*store, "a mesh").digest;
    result = write(*store, "a result").digest;
    ASSERT_TRUE(store->begin_upload("broken", sha256("abc"), 3));
  }
  std::ofstream(directory / "part-77") << "left by a writer that was killed";
  for (const std::string& mesh : {digest, result})
    std::filesystem::last_write_time(directory / mesh,
                                     std::filesystem::file_time_type::clock::now() - std::chrono::hours(48));
  {
    const auto store = open();
    store->retain(result);
    ASSERT_TRUE(store->open(result));
    EXPECT_EQ((*store->open(result))->bytes(), "a result");
    store->sweep();
    // Checked in the directory, since open() counts as a use.
    EXPECT_TRUE(std::filesystem::exists(directory / digest)) << "a client that was told of it has an hour to use it";
    now += std::chrono::hours(2);
    store->sweep();
    EXPECT_FALSE(store->open(digest));
    ASSERT_TRUE(store->open(result));
    store->release(result);
  }
  EXPECT_TRUE(std::filesystem::is_empty(directory));
  std::filesystem::remove(directory);
}

/// A directory with a mesh that jobs refer to, and one that a client has uploaded.
class DamagedMesh : public ::testing::Test {
 protected:
  DamagedMesh() {
    std::string name = ::testing::TempDir() + "varimesh-damaged-XXXXXX";
    directory_ = ::mkdtemp(name.data());
    store_ = std::move(*DirectoryMeshStore::open_directory(directory_.string(), settings_with()));
    referred_ = write(*store_, bytes_).digest;
    pinned_ = upload("another mesh");
  }
  ~DamagedMesh() override {
    store_.reset();
    std::filesystem::remove_all(directory_);
  }

  /// Uploads a mesh unless the store says that it has it, and returns its digest.
  std::string upload(const std::string& bytes) {
    const auto ticket = store_->begin_upload("id", sha256(bytes), static_cast<std::int64_t>(bytes.size()));
    EXPECT_TRUE(ticket);
    if (ticket->complete) return sha256(bytes);
    EXPECT_TRUE(store_->append(*ticket, 0, bytes));
    const auto stored = store_->finish_upload(*ticket);
    return stored ? stored->digest : stored.error().sentence;
  }
  void flip_bit(const std::string& digest, std::int64_t at) {
    std::fstream file(directory_ / digest, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(at);
    const char byte = static_cast<char>(file.get() ^ 4);
    file.seekp(at);
    file.put(byte);
  }

  std::filesystem::path directory_;
  const std::string bytes_ = std::string(900, 'm');
  std::unique_ptr<DirectoryMeshStore> store_;
  std::string referred_, pinned_;
};

TEST_F(DamagedMesh, IsNeverServed) {
  const std::vector<std::function<void(const std::string&)>> damages{
      [&](const std::string& digest) { flip_bit(digest, 0); }, [&](const std::string& digest) { flip_bit(digest, 10); },
      [&](const std::string& digest) { std::filesystem::resize_file(directory_ / digest, 5); },
      [&](const std::string& digest) { std::filesystem::resize_file(directory_ / digest, 5000); },
      [&](const std::string& digest) { std::filesystem::remove(directory_ / digest); }};
  for (const auto& damage : damages)
    for (const bool whole : {true, false}) {
      for (const std::string& digest : {referred_, pinned_}) {
        damage(digest);
        const auto code = whole ? store_->open(digest).error().code : store_->read(digest).error().code;
        EXPECT_EQ(code, Failure::Code::DataLoss);
        EXPECT_EQ(store_->open(digest).error().code, Failure::Code::NotFound) << "its entry is dropped";
        EXPECT_FALSE(store_->pin(digest)) << "a client is told to send it again";
        EXPECT_FALSE(std::filesystem::exists(directory_ / digest));
      }
      EXPECT_EQ(upload(bytes_), referred_);
      EXPECT_EQ(upload("another mesh"), pinned_);
      EXPECT_EQ((*store_->open(referred_))->bytes(), bytes_);
      EXPECT_EQ((*store_->open(pinned_))->bytes(), "another mesh");
    }
  store_->release(referred_);
  EXPECT_TRUE(store_->open(referred_)) << "it is pinned by its upload";
}

TEST_F(DamagedMesh, IsMovedAside) {
  flip_bit(pinned_, 0);
  EXPECT_EQ(store_->open(pinned_).error().code, Failure::Code::DataLoss);
  std::string kept;
  std::getline(std::ifstream(directory_ / "damaged" / pinned_), kept);
  EXPECT_EQ(kept, "enother mesh") << "an operator may look at it";
  store_.reset();
  store_ = std::move(*DirectoryMeshStore::open_directory(directory_.string(), settings_with()));
  EXPECT_TRUE(store_->open(referred_));
}

TEST_F(DamagedMesh, IsNotDeletedIfItCannotBeMoved) {
  std::ofstream(directory_ / "damaged") << "a file where the folder should be";
  flip_bit(pinned_, 0);
  EXPECT_EQ(store_->open(pinned_).error().code, Failure::Code::DataLoss);
  EXPECT_EQ(store_->open(pinned_).error().code, Failure::Code::NotFound);
  std::string kept;
  std::getline(std::ifstream(directory_ / pinned_), kept);
  EXPECT_EQ(kept, "enother mesh");
  EXPECT_EQ(upload("another mesh"), pinned_);
  EXPECT_EQ(read_whole(*store_, pinned_), "another mesh");
}

TEST_F(DamagedMesh, IsNoneThatCannotBeReadForAMoment) {
  // A folder can be opened, but reading it fails, with EISDIR. Its size is that of the mesh.
  std::filesystem::create_directory(directory_ / "folder");
  struct stat status {};
  ASSERT_EQ(::lstat((directory_ / "folder").c_str(), &status), 0);
  DirectoryMeshSettings settings = settings_with();
  settings.max_mesh_bytes = 1 << 20;
  store_ = std::move(*DirectoryMeshStore::open_directory(directory_.string(), settings));
  const std::string digest = upload(std::string(static_cast<std::size_t>(status.st_size), 'm'));
  std::filesystem::rename(directory_ / digest, directory_ / "away");
  std::filesystem::rename(directory_ / "folder", directory_ / digest);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(store_->open(digest).error().code, Failure::Code::Internal);
    EXPECT_EQ(store_->read(digest).error().code, Failure::Code::Internal);
  }
  std::filesystem::remove(directory_ / digest);
  std::filesystem::rename(directory_ / "away", directory_ / digest);
  EXPECT_TRUE(store_->open(digest)) << "nothing was removed";
}

TEST_F(DamagedMesh, IsTakenAgainIfItsFileIsMissing) {
  for (const std::string& digest : {referred_, pinned_}) std::filesystem::remove(directory_ / digest);
  EXPECT_EQ(upload(bytes_), referred_);
  EXPECT_EQ(upload("another mesh"), pinned_);
  EXPECT_EQ((*store_->open(referred_))->bytes(), bytes_);
  EXPECT_EQ((*store_->open(pinned_))->bytes(), "another mesh");
}

TEST_F(DamagedMesh, DoesNotReachWhoHasOpenedIt) {
  const auto opened = *store_->open(referred_);
  std::filesystem::resize_file(directory_ / referred_, 0);
  EXPECT_EQ(opened->bytes(), bytes_) << "a mapped file would end the process here";
}

TEST_F(DamagedMesh, IsReplacedByAResultWithTheSameBytes) {
  flip_bit(referred_, 3);
  EXPECT_EQ(write(*store_, bytes_).digest, referred_);
  EXPECT_EQ((*store_->open(referred_))->bytes(), bytes_);
}

TEST(DirectoryMeshStore, FollowsNoLinks) {
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) / "varimesh-links";
  std::filesystem::create_directories(folder / "meshes");
  std::ofstream(folder / "secret") << "of the system";
  const std::string before(64, 'a');
  std::filesystem::create_symlink(folder / "secret", folder / "meshes" / before);
  {
    const auto store = std::move(*DirectoryMeshStore::open_directory((folder / "meshes").string(), settings_with()));
    EXPECT_FALSE(store->open(before)) << "a link that was there before the server";
    EXPECT_FALSE(store->read(before));
    const std::string digest = write(*store, "a mesh").digest;
    std::filesystem::remove(folder / "meshes" / digest);
    std::filesystem::create_symlink(folder / "secret", folder / "meshes" / digest);
    EXPECT_FALSE(store->open(digest)) << "a link that took the place of a mesh";
    EXPECT_FALSE(store->read(digest));
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "secret"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace varimesh::server::testing
