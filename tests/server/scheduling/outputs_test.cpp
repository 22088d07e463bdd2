// An attempt on a disk that is full for a while.
#include "server/scheduling/outputs.h"

#include <gtest/gtest.h>

#include <cerrno>

#include "server/refusals.h"
#include "server/scheduling/attempt.h"
#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {
namespace {

/// A store whose disk is full for every second call that needs room, or for all of them.
class FullStore : public MeshStore {
 public:
  explicit FullStore(MeshStore& store) : store_(store) {}

  enum class Refuses { Nothing, EverySecond, Everything } refuses = Refuses::Nothing;
  bool refuses_commits = false;
  int refused = 0;

  Answer<std::unique_ptr<BlobWriter>> create(std::optional<std::int64_t> announced) override {
    if (refuse()) return store_full("No room");
    return store_.create(announced).map([this](auto writer) -> std::unique_ptr<BlobWriter> {
      return std::make_unique<Writer>(*this, std::move(writer));
    });
  }
  Answer<std::shared_ptr<const Blob>> open(const std::string& digest) override {
    if (refuse()) return store_full("No room");
    return store_.open(digest);
  }

  bool has_room(std::int64_t) const override { return refuses == Refuses::Nothing; }
  Answer<UploadTicket> begin_upload(const std::string&, const std::string&, std::int64_t, const std::string&) override {
    return store_unavailable();
  }
  Answer<std::int64_t> append(const UploadTicket&, std::int64_t, std::string_view) override {
    return store_unavailable();
  }
  Answer<StoredBytes> finish_upload(const UploadTicket&) override { return store_unavailable(); }
  Answer<UploadProgress> query_upload(const std::string&, const std::string&, const std::string&) override {
    return store_unavailable();
  }
  Answer<std::unique_ptr<BlobReader>> read(const std::string& digest) override { return store_.read(digest); }
  Answer<std::int64_t> size_of(const std::string& digest) override { return store_.size_of(digest); }
  bool pin(const std::string& digest) override { return store_.pin(digest); }
  bool touch(const std::string& digest) override { return store_.touch(digest); }
  Answer<void> remove(const std::string& digest, const std::string& owner) override {
    return store_.remove(digest, owner);
  }
  void grant(const std::string& digest, const std::string& owner) override { store_.grant(digest, owner); }
  bool belongs_to(const std::string& digest, const std::string& owner) override {
    return store_.belongs_to(digest, owner);
  }
  void retain(const std::string& digest) override { store_.retain(digest); }
  void release(const std::string& digest) override { store_.release(digest); }
  void sweep() override {}

 private:
  class Writer : public BlobWriter {
   public:
    Writer(FullStore& store, std::unique_ptr<BlobWriter> writer) : store_(store), writer_(std::move(writer)) {}
    bool append(std::string_view bytes) override {
      if (!store_.refuse()) return writer_->append(bytes);
      errno = ENOSPC;
      return false;
    }
    Answer<StoredBytes> commit() override {
      if (store_.refuses_commits) return store_full("No room");
      return writer_->commit();
    }

   private:
    FullStore& store_;
    std::unique_ptr<BlobWriter> writer_;
  };

  bool refuse() {
    if (refuses == Refuses::Nothing || (refuses == Refuses::EverySecond && calls_++ % 2 == 1)) return false;
    ++refused;
    return true;
  }

  MeshStore& store_;
  int calls_ = 0;
};

class FullDisk : public ::testing::Test {
 protected:
  FullDisk() : meshes_(new_store()), store_(*meshes_) {
    claim_.name = "jobs/1";
    claim_.attempt = 1;
    claim_.spec.mutable_mesh()->set_digest(write(*meshes_, "a mesh").digest);
  }

  /// Runs an attempt whose result has two pieces.
  Ending run(const std::function<void()>& before_the_end = [] {}) {
    Engine engine;
    engine.run = [&](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
      before_the_end();
      const Sink sink = hooks.open_output(v1::MESH_FORMAT_MSH22);
      if (!sink("a re") || !sink("sult")) return tl::unexpected(Error{Error::Kind::Output, "The sink is full."});
      RunSummary outcome;
      outcome.history.resize(1);
      return outcome;
    };
    const LentThreads threads{[] { return 2; }};
    Attempt attempt{claim_,
                    engine,
                    store_,
                    log_,
                    threads,
                    memory_,
                    [] { return TimePoint(); },
                    [] { return Time(); },
                    [this] { return cancelled_; },
                    [this] { return stopping_; },
                    [](const v1::Iteration&) {},
                    std::chrono::milliseconds(0),
                    nullptr};
    attempt.store_pause = std::chrono::milliseconds(1);
    return run_attempt(attempt);
  }

  std::unique_ptr<DirectoryMeshStore> meshes_;
  FullStore store_;
  Claim claim_;
  EventLog log_;
  MemoryBudget memory_{1000};
  bool cancelled_ = false, stopping_ = false;
};

TEST_F(FullDisk, IsWaitedForWhereverItRefuses) {
  store_.refuses = FullStore::Refuses::EverySecond;
  const Ending ending = run();
  EXPECT_EQ(ending.state, v1::JOB_STATE_SUCCEEDED);
  ASSERT_EQ(ending.results.size(), 1U);
  EXPECT_EQ(read_whole(*meshes_, ending.results[0].digest()), "a result");
  EXPECT_FALSE(ending.history_digest.empty());
  EXPECT_EQ(store_.refused, 6) << "the mesh, an output, its two pieces, the history, and its bytes";
  EXPECT_EQ(log_.last_sequence(), 1) << "it says once that it waits";
}

TEST_F(FullDisk, LetsAJobBeCancelledWithoutAResult) {
  const Ending ending = run([&] {
    store_.refuses = FullStore::Refuses::Everything;
    cancelled_ = true;
  });
  EXPECT_EQ(ending.state, v1::JOB_STATE_CANCELLED);
  EXPECT_TRUE(ending.results.empty());
  EXPECT_FALSE(ending.error);
}

TEST_F(FullDisk, LeavesAJobToTheNextServer) {
  const Ending ending = run([&] {
    store_.refuses = FullStore::Refuses::Everything;
    stopping_ = true;
  });
  EXPECT_EQ(ending.state, v1::JOB_STATE_PENDING);
  EXPECT_TRUE(ending.results.empty());
}

TEST_F(FullDisk, HasTheRunRepeatedIfTheSystemCannotWriteWhatItHasTaken) {
  store_.refuses_commits = true;
  EXPECT_EQ(run().state, v1::JOB_STATE_PENDING);
  EXPECT_EQ(log_.last_sequence(), 1) << "it says that it waits, instead of starting again at once";
  EXPECT_FALSE(meshes_->open(sha256("a result")));
}

TEST_F(FullDisk, IsNotWaitedForIfAnotherFailureIsBehindIt) {
  meshes_->release(claim_.spec.mesh().digest());
  const Ending ending = run();
  EXPECT_EQ(ending.state, v1::JOB_STATE_FAILED);
  EXPECT_EQ(log_.last_sequence(), 0);
}

}  // namespace
}  // namespace varimesh::server::testing
