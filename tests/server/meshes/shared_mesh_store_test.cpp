// Meshes in a directory that two servers use at the same time.
#include "server/meshes/shared_mesh_store.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <shared_mutex>
#include <thread>

#include "server/refusals.h"
#include "tests/server/meshes/stores.h"

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
    return std::move(*SharedMeshStore::open_directory(directory_.string(), ::testing::TempDir(), settings,
                                                      [this]() -> Answer<SharedMeshStore::Digests> {
                                                        if (on_question_) on_question_();
                                                        if (is_away_) return store_unavailable();
                                                        return needed_;
                                                      }));
  }
  /// Uploads a mesh unless the store says that it has it, and returns its digest.
  static std::string upload(MeshStore& store, const std::string& bytes, const std::string& owner = {}) {
    const auto ticket = store.begin_upload("id", sha256(bytes), static_cast<std::int64_t>(bytes.size()), owner);
    EXPECT_TRUE(ticket);
    if (ticket->complete) return sha256(bytes);
    EXPECT_TRUE(store.append(*ticket, 0, bytes));
    const auto stored = store.finish_upload(*ticket);
    return stored ? stored->digest : stored.error().sentence;
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
  SharedMeshStore::Digests needed_;
  bool is_away_ = false;
  std::function<void()> on_question_;
  std::unique_ptr<SharedMeshStore> one_, two_;
};

TEST_F(SharedMeshes, AreThereForBothAtOnce) {
  const std::string mesh = upload(*one_, "a mesh"), result = write(*two_, "a result").digest;
  EXPECT_EQ((*two_->open(mesh))->bytes(), "a mesh");
  EXPECT_EQ((*one_->open(result))->bytes(), "a result");
  EXPECT_EQ(*one_->size_of(result), 8);
  EXPECT_TRUE(two_->touch(mesh));
  EXPECT_TRUE(two_->begin_upload("another", mesh, 6)->complete);
  EXPECT_TRUE(two_->remove(mesh));
  EXPECT_EQ(one_->open(mesh).error().code, Failure::Code::NotFound);
  EXPECT_FALSE(one_->touch(mesh));
}

TEST_F(SharedMeshes, BelongToWhoSentThemToAnyServer) {
  const std::string mesh = upload(*one_, "a mesh", "anna");
  EXPECT_TRUE(two_->belongs_to(mesh, "anna"));
  EXPECT_FALSE(two_->belongs_to(mesh, "bert"));
  EXPECT_FALSE(two_->begin_upload("id", mesh, 6, "bert")->complete) << "he must send the bytes";
  EXPECT_EQ(upload(*two_, "a mesh", "bert"), mesh);
  EXPECT_TRUE(one_->belongs_to(mesh, "bert"));
  EXPECT_TRUE(two_->remove(mesh, "anna"));
  EXPECT_EQ(one_->remove(mesh, "anna").error().code, Failure::Code::NotFound);
  EXPECT_TRUE(one_->open(mesh)) << "Bert still has it";
  EXPECT_TRUE(one_->remove(mesh, "bert"));
  EXPECT_FALSE(has(mesh));
}

TEST_F(SharedMeshes, AreUploadedThroughTwoServers) {
  const std::string bytes = "abcdefghi", digest = sha256(bytes);
  const auto first = one_->begin_upload("id", digest, 9, "anna");
  ASSERT_TRUE(one_->append(*first, 0, "abc"));
  EXPECT_EQ(two_->query_upload("id", digest, "anna")->committed, 3);
  EXPECT_FALSE(two_->query_upload("id", digest, "bert")) << "each owner has ids of its own";
  const auto second = two_->begin_upload("id", digest, 9, "anna");
  EXPECT_EQ(second->committed, 3);
  EXPECT_EQ(one_->append(*first, 3, "def").error().reason, "UPLOAD_TAKEN_OVER");
  EXPECT_EQ(two_->append(*second, 2, "cde").error().reason, "WRONG_OFFSET");
  ASSERT_TRUE(two_->append(*second, 3, "def"));
  EXPECT_EQ(two_->begin_upload("id", sha256("other"), 5, "anna").error().reason, "UPLOAD_ID_USED");
  EXPECT_EQ(two_->finish_upload(*second).error().metadata.at("committed_size"), "6");
  const auto third = one_->begin_upload("id", digest, 9, "anna");
  ASSERT_TRUE(one_->append(*third, 6, "ghi"));
  EXPECT_EQ(one_->finish_upload(*third)->digest, digest);
  EXPECT_TRUE(two_->query_upload("id", digest, "anna")->complete);
  EXPECT_EQ((*two_->open(digest))->bytes(), bytes);
  EXPECT_EQ(files(), 3) << "the mesh, its pin and its owner";
}

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
  const auto refused = SharedMeshStore::open_directory(directory_.string(), ::testing::TempDir(), settings_with(),
                                                       [] { return SharedMeshStore::Digests(); });
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().sentence.find("--meshes"), std::string::npos) << refused.error().sentence;
  wait(hours(2));
  EXPECT_TRUE(has(digest + ".zst")) << "what the store does not know stays";
}

TEST_F(SharedMeshes, AreRefusedWithOtherBytes) {
  const auto ticket = one_->begin_upload("id", sha256("abc"), 3);
  ASSERT_TRUE(one_->append(*ticket, 0, "xyz"));
  EXPECT_EQ(two_->finish_upload(*ticket).error().reason, "DIGEST_MISMATCH");
  EXPECT_EQ(files(), 0);
  const auto longer = one_->begin_upload("id", sha256("abc"), 3);
  EXPECT_EQ(one_->append(*longer, 0, "abcd").error().reason, "MESH_LARGER_THAN_SAID");
  EXPECT_EQ(files(), 0);
}

TEST_F(SharedMeshes, TakeAnUploadAgainAfterAServerWasKilledInIt) {
  const auto ticket = one_->begin_upload("id", sha256("abc"), 3);
  ASSERT_TRUE(one_->append(*ticket, 0, "ab"));
  for (const auto& file : std::filesystem::directory_iterator(directory_))
    if (file.path().extension() == ".about") std::filesystem::resize_file(file.path(), 20);  // half a line
  EXPECT_EQ(upload(*two_, "abc"), sha256("abc"));
}

TEST_F(SharedMeshes, StayAsLongAsAJobNeedsThem) {
  const std::string kept = upload(*one_, "a mesh"), needed = write(*one_, "a result").digest,
                    dropped = write(*one_, "a checkpoint").digest;
  needed_ = {needed};
  one_->release(dropped);
  one_->sweep();
  EXPECT_TRUE(has(dropped)) << "an equal job may just have stored the same bytes";
  wait(minutes(2));
  EXPECT_FALSE(has(dropped)) << "replaced checkpoints would fill the disk";
  wait(hours(23));
  EXPECT_TRUE(has(kept));
  EXPECT_TRUE(two_->touch(kept)) << "it is used again";
  wait(hours(23));
  EXPECT_TRUE(has(kept));
  wait(hours(2));
  EXPECT_FALSE(has(kept));
  EXPECT_TRUE(has(needed));
  EXPECT_EQ(files(), 2) << "the mesh, and the lock of who sweeps";
  needed_ = {};
  wait(minutes(2));
  EXPECT_FALSE(has(needed)) << "its job was deleted";
}

TEST_F(SharedMeshes, AreSweptByAnotherServerWhenTheFirstHasEnded) {
  const std::string dropped = write(*one_, "a result that no job has").digest;
  wait(minutes(5));
  one_.reset();  // it was the one that swept, and it cannot say that it needs nothing
  for (int i = 0; i < 12; ++i) {
    now_ += minutes(1);
    two_->sweep();
  }
  EXPECT_FALSE(has(dropped));
}

TEST_F(SharedMeshes, AreNotSweptWhileNobodyKnowsWhatJobsNeed) {
  const std::string result = write(*one_, "a result").digest;
  one_->release(result);
  is_away_ = true;
  wait(hours(2));
  EXPECT_TRUE(has(result));
}

TEST_F(SharedMeshes, WaitForADatabaseThatComesBack) {
  // The worker has stored a result, and cannot tell the database for two hours.
  const std::string result = write(*one_, "a result").digest;
  is_away_ = true;
  wait(hours(2));
  is_away_ = false;
  one_->sweep();  // before the worker could tell it
  two_->sweep();
  EXPECT_TRUE(has(result));
  needed_ = {result};
  wait(hours(2));
  EXPECT_TRUE(has(result));
}

TEST_F(SharedMeshes, AreSavedByAUseAtTheLastMoment) {
  const std::string result = write(*one_, "a result").digest;
  one_->release(result);
  now_ += minutes(1);
  on_question_ = [&] { EXPECT_TRUE(two_->touch(result)) << "a job that needs it is submitted there"; };
  one_->sweep();
  now_ += minutes(1);
  one_->sweep();
  EXPECT_TRUE(has(result));
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

TEST_F(SharedMeshes, AreNotServedWhenTheyAreDamaged) {
  const std::string bytes(900, 'm'), digest = upload(*one_, bytes);
  for (const bool whole : {true, false}) {
    { std::fstream(directory_ / digest, std::ios::in | std::ios::out | std::ios::binary).put('x'); }
    const auto code = whole ? two_->open(digest).error().code : two_->read(digest).error().code;
    EXPECT_EQ(code, Failure::Code::DataLoss);
    EXPECT_EQ(one_->open(digest).error().code, Failure::Code::NotFound);
    EXPECT_FALSE(one_->begin_upload("id", digest, 900)->complete) << "a client is told to send it again";
    EXPECT_EQ(upload(*one_, bytes), digest);
    EXPECT_EQ((*two_->open(digest))->bytes(), bytes);
  }
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

TEST_F(SharedMeshes, AreStoredAndSweptByManyAtTheSameTime) {
  // A job's mesh that was there when the job was stored must be there for the worker. To the sweepers every file has
  // rested for long. So no upload is under way while they look; it would be dropped.
  std::mutex mutex;
  std::shared_mutex uploading;
  SharedMeshStore::Digests needed;
  const auto referenced = [&]() -> Answer<SharedMeshStore::Digests> {
    std::lock_guard lock(mutex);
    return needed;
  };
  std::atomic<std::int64_t> minute = 0;
  std::atomic<bool> done = false;
  DirectoryMeshSettings settings = settings_with([&] { return Time(hours(1000) + minutes(minute.load())); });
  std::vector<std::unique_ptr<SharedMeshStore>> servers;
  for (int i = 0; i < 3; ++i)
    servers.push_back(
        std::move(*SharedMeshStore::open_directory(directory_.string(), ::testing::TempDir(), settings, referenced)));
  // The sweepers' clocks run as fast as they can; a mesh has rested for long at every look.
  std::vector<std::thread> sweepers;
  for (const int i : {1, 2})
    sweepers.emplace_back([&, i] {
      while (!done) {
        minute += 20;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));  // a lock that readers hold is unfair to writers
        std::shared_lock looking(uploading);
        servers[static_cast<std::size_t>(i)]->sweep();
      }
    });
  int there = 0;
  for (int i = 0; i < 300; ++i) {
    std::string digest;
    {
      std::unique_lock nobody_looks(uploading);
      digest = upload(*servers[0], "mesh " + std::to_string(i % 5));
    }
    {
      std::lock_guard lock(mutex);
      needed.insert(digest);
    }
    // A client whose mesh was swept before is told to send it again.
    if (servers[0]->touch(digest)) {
      ++there;
      EXPECT_TRUE(servers[0]->open(digest));
    }
    std::lock_guard lock(mutex);
    needed.erase(digest);
  }
  done = true;
  for (std::thread& sweeper : sweepers) sweeper.join();
  EXPECT_GT(there, 0);
}

}  // namespace
}  // namespace varimesh::server::testing
