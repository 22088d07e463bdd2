// What servers that share meshes rely on.
#include "tests/server/meshes/shared/shared_store_conformance.h"

#include <atomic>
#include <shared_mutex>
#include <thread>

#include "server/refusals.h"

namespace varimesh::server::testing {

using std::chrono::hours, std::chrono::minutes;

std::unique_ptr<MeshStore> SharedStoreConformance::open() {
  return place_->open(settings_with([this] { return now_; }), [this](const Digests& asked) -> Answer<Digests> {
    if (on_question_) on_question_();
    if (is_away_) return store_unavailable();
    return both(asked, needed_);
  });
}

void SharedStoreConformance::wait(minutes time) {
  const minutes step = time > hours(1) ? minutes(5) : minutes(1);
  for (minutes passed{0}; passed < time; passed += step) {
    now_ += step;
    if (one_ != nullptr) one_->sweep();
    two_->sweep();
  }
}

namespace {

TEST_P(SharedStoreConformance, HasMeshesForBothAtOnce) {
  const std::string mesh = upload(*one_, "a mesh"), result = write(*two_, "a result").digest;
  EXPECT_EQ(read_whole(*two_, mesh), "a mesh");
  EXPECT_EQ(read_whole(*one_, result), "a result");
  EXPECT_EQ((*(*one_->read(result))->read(2, false)).bytes, "result");
  EXPECT_EQ(*one_->size_of(result), 8);
  EXPECT_TRUE(two_->touch(mesh));
  EXPECT_TRUE(two_->begin_upload("another", mesh, 6)->complete);
  EXPECT_TRUE(two_->remove(mesh));
  EXPECT_EQ(one_->open(mesh).error().code, Failure::Code::NotFound);
  EXPECT_EQ(two_->open(mesh).error().code, Failure::Code::NotFound);
  EXPECT_FALSE(one_->touch(mesh));
  EXPECT_FALSE(one_->pin(mesh));
  EXPECT_EQ(one_->size_of(mesh).error().code, Failure::Code::NotFound);
  EXPECT_EQ(one_->open("../name").error().code, Failure::Code::NotFound) << "only digests are names";
}

TEST_P(SharedStoreConformance, KnowsWhoSentAMeshToAnyServer) {
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
  EXPECT_FALSE(place_->has(mesh));
  const std::string result = write(*one_, "a result").digest;
  one_->grant(result, "anna");
  EXPECT_TRUE(two_->belongs_to(result, "anna"));
}

TEST_P(SharedStoreConformance, DoesNotRemoveWhatJobsNeed) {
  const std::string mesh = upload(*one_, "a mesh", "anna");
  needed_ = {mesh};
  EXPECT_EQ(two_->remove(mesh).error().reason, "MESH_IN_USE");
  EXPECT_TRUE(two_->remove(mesh, "anna"));
  EXPECT_FALSE(one_->belongs_to(mesh, "anna"));
  EXPECT_TRUE(one_->open(mesh));
  is_away_ = true;
  EXPECT_EQ(two_->remove(mesh).error().code, Failure::Code::Unavailable);
}

TEST_P(SharedStoreConformance, TakesAnUploadThroughTwoServers) {
  const std::string bytes = "abcdefghi", digest = sha256(bytes);
  auto first = one_->begin_upload("id", digest, 9, "anna");
  ASSERT_TRUE(one_->append(*first, 0, "abc"));
  UploadTicket cut = *first;
  cut.room = nullptr;
  first->room = nullptr;  // the stream has ended
  for (int i = 0; i < 100 && two_->query_upload("id", digest, "anna")->committed < 3; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(two_->query_upload("id", digest, "anna")->committed, 3);
  EXPECT_FALSE(two_->query_upload("id", digest, "bert")) << "each owner has ids of its own";
  auto second = two_->begin_upload("id", digest, 9, "anna");
  EXPECT_EQ(second->committed, 3);
  EXPECT_EQ(two_->append(*second, 2, "cde").error().reason, "WRONG_OFFSET");
  ASSERT_TRUE(two_->append(*second, 3, "def"));
  EXPECT_EQ(two_->begin_upload("id", sha256("other"), 5, "anna").error().reason, "UPLOAD_ID_USED");
  EXPECT_EQ(two_->finish_upload(*second).error().metadata.at("committed_size"), "6");
  // A stream that was taken over learns of it when it ends at the latest.
  const auto more = one_->append(cut, 3, "defghi");
  EXPECT_EQ(more ? one_->finish_upload(cut).error().reason : more.error().reason, "UPLOAD_TAKEN_OVER");
  second->room = nullptr;
  for (int i = 0; i < 100 && one_->query_upload("id", digest, "anna")->committed < 6; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  const auto third = one_->begin_upload("id", digest, 9, "anna");
  ASSERT_EQ(third->committed, 6);
  ASSERT_TRUE(one_->append(*third, 6, "ghi"));
  EXPECT_EQ(one_->finish_upload(*third)->digest, digest);
  EXPECT_TRUE(two_->query_upload("id", digest, "anna")->complete);
  EXPECT_EQ(read_whole(*two_, digest), bytes);
}

TEST_P(SharedStoreConformance, RefusesOtherBytes) {
  const auto ticket = one_->begin_upload("id", sha256("abc"), 3);
  ASSERT_TRUE(one_->append(*ticket, 0, "xyz"));
  EXPECT_EQ(one_->finish_upload(*ticket).error().reason, "DIGEST_MISMATCH");
  EXPECT_FALSE(two_->query_upload("id", sha256("abc"))) << "nothing of it is left";
  const auto longer = one_->begin_upload("id", sha256("abc"), 3);
  EXPECT_EQ(one_->append(*longer, 0, "abcd").error().reason, "MESH_LARGER_THAN_SAID");
  EXPECT_FALSE(place_->has(sha256("abc")));
  EXPECT_EQ(upload(*two_, "abc"), sha256("abc"));
  EXPECT_EQ(one_->begin_upload("id", "not a digest", 3).error().code, Failure::Code::InvalidArgument);
  EXPECT_EQ(one_->begin_upload("id", sha256("long"), 1001).error().reason, "MESH_TOO_LARGE");
}

TEST_P(SharedStoreConformance, TakesAMeshOfNoBytes) {
  EXPECT_EQ(upload(*one_, ""), sha256(""));
  EXPECT_EQ(read_whole(*two_, sha256("")), "");
}

TEST_P(SharedStoreConformance, KeepsMeshesAsLongAsAJobNeedsThem) {
  const std::string kept = upload(*one_, "a mesh"), needed = write(*one_, "a result").digest,
                    dropped = write(*one_, "a checkpoint").digest;
  needed_ = {needed};
  one_->release(dropped);
  one_->sweep();
  EXPECT_TRUE(place_->has(dropped)) << "an equal job may just have stored the same bytes";
  wait(minutes(2));
  EXPECT_FALSE(place_->has(dropped)) << "replaced checkpoints would fill the place";
  wait(hours(23));
  EXPECT_TRUE(place_->has(kept));
  EXPECT_TRUE(two_->touch(kept)) << "it is used again";
  wait(hours(23));
  EXPECT_TRUE(place_->has(kept));
  wait(hours(2));
  EXPECT_FALSE(place_->has(kept));
  EXPECT_TRUE(place_->has(needed));
  needed_ = {};
  wait(minutes(11));
  EXPECT_FALSE(place_->has(needed)) << "its job was deleted";
}

TEST_P(SharedStoreConformance, IsSweptByAnotherServerWhenTheFirstHasEnded) {
  const std::string dropped = write(*one_, "a result that no job has").digest;
  wait(minutes(5));
  one_.reset();  // it was the one that swept, and it cannot say that it needs nothing
  wait(minutes(40));
  EXPECT_FALSE(place_->has(dropped));
}

TEST_P(SharedStoreConformance, IsNotSweptWhileNobodyKnowsWhatJobsNeed) {
  const std::string result = write(*one_, "a result").digest;
  one_->release(result);
  is_away_ = true;
  wait(hours(2));
  EXPECT_TRUE(place_->has(result));
}

TEST_P(SharedStoreConformance, WaitsForADatabaseThatComesBack) {
  // The worker has stored a result, and cannot tell the database for two hours.
  const std::string result = write(*one_, "a result").digest;
  is_away_ = true;
  wait(hours(2));
  is_away_ = false;
  one_->sweep();  // before the worker could tell it
  two_->sweep();
  EXPECT_TRUE(place_->has(result));
  needed_ = {result};
  wait(hours(2));
  EXPECT_TRUE(place_->has(result));
}

TEST_P(SharedStoreConformance, TellsTheTruthToAUseAtTheLastMoment) {
  const std::string result = write(*one_, "a result").digest;
  one_->release(result);
  now_ += minutes(1);
  bool was_there = false;
  on_question_ = [&] { was_there = two_->touch(result); };  // a job that needs it is submitted there
  one_->sweep();
  on_question_ = nullptr;
  EXPECT_EQ(place_->has(result), was_there);
  EXPECT_EQ(write(*two_, "a result").digest, result) << "a client that is told so stores it again";
  now_ += minutes(1);
  one_->sweep();
  EXPECT_TRUE(place_->has(result));
}

TEST_P(SharedStoreConformance, DoesNotServeDamagedMeshes) {
  const std::string bytes(900, 'm'), digest = upload(*one_, bytes);
  for (const bool whole : {true, false}) {
    two_ = open();  // without a copy of its own
    place_->damage(digest);
    const auto code = whole ? two_->open(digest).error().code : two_->read(digest).error().code;
    EXPECT_EQ(code, Failure::Code::DataLoss);
    EXPECT_EQ(one_->open(digest).error().code, Failure::Code::NotFound);
    EXPECT_FALSE(one_->begin_upload("id", digest, 900)->complete) << "a client is told to send it again";
    EXPECT_EQ(upload(*one_, bytes), digest);
    EXPECT_EQ(read_whole(*two_, digest), bytes);
  }
}

TEST_P(SharedStoreConformance, IsUsedAndSweptByManyAtTheSameTime) {
  // A job's mesh that was there when the job was stored must be there for the worker. To the sweepers everything has
  // rested for long. So no upload is under way while they look; it would be dropped.
  std::mutex mutex;
  std::shared_mutex uploading;
  Digests needed;
  const auto referenced = [&](const Digests& asked) -> Answer<Digests> {
    std::lock_guard lock(mutex);
    return both(asked, needed);
  };
  std::atomic<std::int64_t> minute = 0;
  std::atomic<bool> done = false, uploads = false;
  const DirectoryMeshSettings settings = settings_with([&] { return Time(hours(1000) + minutes(minute.load())); });
  std::vector<std::unique_ptr<MeshStore>> servers;
  for (int i = 0; i < 3; ++i) servers.push_back(place_->open(settings, referenced));
  // The sweepers' clocks run as fast as they can; a mesh has rested for long at every look.
  std::vector<std::thread> sweepers;
  for (const int i : {1, 2})
    sweepers.emplace_back([&, i] {
      while (!done) {
        minute += 20;
        // A lock that readers hold is unfair to writers, above all if the place is slow.
        do {
          std::this_thread::sleep_for(std::chrono::milliseconds(1));
        } while (uploads && !done);
        std::shared_lock looking(uploading);
        servers[static_cast<std::size_t>(i)]->sweep();
      }
    });
  int there = 0;
  for (int i = 0; i < place_->repetitions(); ++i) {
    std::string digest;
    {
      uploads = true;
      std::unique_lock nobody_looks(uploading);
      uploads = false;
      digest = upload(*servers[0], "mesh " + std::to_string(i % 5));
    }
    {
      std::lock_guard lock(mutex);
      needed.insert(digest);
    }
    // A client whose mesh was swept before is told to send it again.
    if (servers[0]->touch(digest)) {
      ++there;
      EXPECT_TRUE(place_->open(settings, referenced)->open(digest)) << "a worker that has no copy opens it";
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
