// Meshes in a directory that two servers use at the same time: the conformance suite, and what only a directory has.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/meshes/shared/shared_directory.h"
#include "tests/server/meshes/shared/shared_store_conformance.h"

namespace varimesh::server::testing {
namespace {

using std::chrono::hours, std::chrono::minutes;

/// Two servers, and what the jobs in their database need.
class SharedMeshes : public ::testing::Test {
 protected:
  SharedMeshes() {
    std::string name = ::testing::TempDir() + "varimesh-shared-XXXXXX";
    directory_ = ::mkdtemp(name.data());
    one_ = open();
    two_ = open();
  }
  ~SharedMeshes() override { std::filesystem::remove_all(directory_); }

  std::unique_ptr<SharedMeshStore> open() {
    DirectoryMeshSettings settings = settings_with([this] { return now_; });
    settings.max_total_bytes = most_;
    return std::move(
        *open_shared_directory(directory_.string(), ::testing::TempDir(), settings,
                               [this](const Digests& asked) -> Answer<Digests> { return both(asked, needed_); }));
  }
  /// Both servers look at the directory once a minute.
  void wait(minutes time) {
    for (minutes passed{0}; passed < time; ++passed) {
      now_ += minutes(1);
      one_->sweep();
      two_->sweep();
    }
  }
  bool has(const std::string& digest) const { return std::filesystem::exists(directory_ / digest); }
  /// How many files there are, besides the given number of meshes.
  std::ptrdiff_t files() const { return std::distance(std::filesystem::directory_iterator(directory_), {}); }

  std::filesystem::path directory_;
  Time now_{hours(1000)};
  std::int64_t most_ = 0;
  Digests needed_;
  std::unique_ptr<SharedMeshStore> one_, two_;
};

TEST_F(SharedMeshes, AreUploadedAgainAfterAServerWasKilledAtTheEnd) {
  const auto ticket = one_->begin_upload("id", sha256("abc"), 3, "anna");
  ASSERT_TRUE(one_->append(*ticket, 0, "abc"));
  for (const auto& file : std::filesystem::directory_iterator(directory_))
    if (file.path().filename().string().starts_with("upload-") && file.path().extension() != ".about")
      std::filesystem::rename(file.path(), directory_ / sha256("abc"));  // and nothing of what follows
  EXPECT_EQ(upload(*two_, "abc", "anna"), sha256("abc"));
  EXPECT_TRUE(one_->belongs_to(sha256("abc"), "anna"));
}

TEST_F(SharedMeshes, AreNotThoseOfAServerThatSharesThemWithNone) {
  const std::string digest = sha256("a result that was compressed");
  { std::ofstream(directory_ / (digest + ".zst")) << "its only copy"; }
  const auto refused = open_shared_directory(directory_.string(), ::testing::TempDir(), settings_with(),
                                             [](const auto&) { return SharedMeshStore::Digests(); });
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().sentence.find("--meshes"), std::string::npos) << refused.error().sentence;
  wait(hours(2));
  EXPECT_TRUE(has(digest + ".zst")) << "what the store does not know stays";
}

TEST_F(SharedMeshes, TakeAnUploadAgainAfterAServerWasKilledInIt) {
  const auto ticket = one_->begin_upload("id", sha256("abc"), 3);
  ASSERT_TRUE(one_->append(*ticket, 0, "ab"));
  for (const auto& file : std::filesystem::directory_iterator(directory_))
    if (file.path().extension() == ".about") std::filesystem::resize_file(file.path(), 20);  // half a line
  EXPECT_EQ(upload(*two_, "abc"), sha256("abc"));
}

TEST_F(SharedMeshes, StayWhileAClockIsSetForth) {
  const std::string kept = upload(*one_, "a mesh"), result = write(*one_, "a result").digest;
  one_->release(result);
  for (const std::string& name : {kept, result})
    std::filesystem::last_write_time(directory_ / name, std::filesystem::file_time_type::clock::now() - hours(100));
  wait(minutes(9));
  EXPECT_TRUE(has(kept) && has(result));
}

TEST_F(SharedMeshes, LoseTheOldestIfThereAreTooMany) {
  most_ = 25;
  one_ = open();
  two_ = open();
  std::vector<std::string> digests;
  for (const char* bytes : {"ten bytes 1", "ten bytes 2", "ten bytes 3", "ten bytes 4"}) {
    digests.push_back(upload(*one_, bytes));
    const auto age = hours(4 - static_cast<int>(digests.size()));
    std::filesystem::last_write_time(directory_ / digests.back(), std::filesystem::file_time_type::clock::now() - age);
  }
  needed_ = {digests[0]};
  wait(minutes(11));
  EXPECT_EQ((std::vector<bool>{has(digests[0]), has(digests[1]), has(digests[2]), has(digests[3])}),
            (std::vector<bool>{true, false, false, true}));
}

TEST_F(SharedMeshes, LeaveNothingOfServersThatWereKilled) {
  { std::ofstream(directory_ / "part-77") << "half a result"; }
  { std::ofstream(directory_ / ("upload-" + sha256("lone"))) << "half an upload"; }
  { std::ofstream(directory_ / (sha256("gone") + ".kept")); }
  ASSERT_TRUE(one_->begin_upload("broken", sha256("abc"), 3));
  const auto slow = two_->begin_upload("slow", sha256("abcdef"), 6);
  for (const char* piece : {"a", "b", "c", "d", "e", "f"}) {
    ASSERT_TRUE(two_->append(*slow, piece[0] - 'a', piece)) << "it goes on every eight minutes";
    wait(minutes(8));
  }
  EXPECT_TRUE(two_->finish_upload(*slow));
  EXPECT_EQ(files(), 3) << "the mesh, its pin, and the lock of who sweeps";
}

TEST_F(SharedMeshes, AreMovedAsideWhenTheyAreDamaged) {
  const std::string digest = upload(*one_, "a mesh");
  { std::ofstream(directory_ / digest) << "a mash"; }
  EXPECT_EQ(one_->open(digest).error().code, Failure::Code::DataLoss);
  EXPECT_FALSE(has(digest));
  std::string kept;
  std::getline(std::ifstream(directory_ / "damaged" / digest), kept);
  EXPECT_EQ(kept, "a mash") << "an operator may look at it";
}

TEST_F(SharedMeshes, FollowNoLinks) {
  std::ofstream(directory_ / "secret") << "of the system";
  const std::string name(64, 'a');
  std::filesystem::create_symlink(directory_ / "secret", directory_ / name);
  EXPECT_FALSE(one_->open(name));
  EXPECT_FALSE(one_->read(name));
  EXPECT_FALSE(one_->touch(name));
  EXPECT_FALSE(one_->begin_upload("id", name, 13)->complete);
  EXPECT_FALSE(one_->open("../secret")) << "only digests are names";
  EXPECT_FALSE(one_->touch("secret"));
}

/// A directory for the conformance suite.
class SharedDirectory : public SharedPlace {
 public:
  SharedDirectory() {
    std::string name = ::testing::TempDir() + "varimesh-shared-XXXXXX";
    directory_ = ::mkdtemp(name.data());
  }
  ~SharedDirectory() override { std::filesystem::remove_all(directory_); }
  std::unique_ptr<MeshStore> open(const DirectoryMeshSettings& settings, AskNeeded needed) override {
    return std::move(*open_shared_directory(directory_.string(), ::testing::TempDir(), settings, std::move(needed)));
  }
  bool has(const std::string& digest) override { return std::filesystem::exists(directory_ / digest); }
  void damage(const std::string& digest) override {
    std::fstream(directory_ / digest, std::ios::in | std::ios::out | std::ios::binary).put('x');
  }

 private:
  std::filesystem::path directory_;
};

INSTANTIATE_TEST_SUITE_P(Directory, SharedStoreConformance,
                         ::testing::Values([] { return std::make_unique<SharedDirectory>(); }));

}  // namespace
}  // namespace varimesh::server::testing
