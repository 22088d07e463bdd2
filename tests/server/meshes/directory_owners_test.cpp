// Whose a mesh is, and how the store keeps that.
#include <fstream>

#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {
namespace {

class DirectoryOwners : public ::testing::Test {
 protected:
  DirectoryOwners() {
    std::string name = ::testing::TempDir() + "varimesh-meshes-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    open();
  }
  ~DirectoryOwners() override {
    store_.reset();
    std::filesystem::remove_all(folder_);
  }
  void open() {
    store_.reset();
    store_ = std::move(*DirectoryMeshStore::open_directory(folder_, settings_with()));
  }
  /// Uploads a mesh; returns whether its bytes had to be sent.
  bool upload(const std::string& bytes, const std::string& owner) {
    const auto ticket = store_->begin_upload("id", sha256(bytes), static_cast<std::int64_t>(bytes.size()), owner);
    EXPECT_TRUE(ticket);
    if (ticket->complete) return false;
    EXPECT_TRUE(store_->append(*ticket, ticket->committed, bytes.substr(static_cast<std::size_t>(ticket->committed))));
    EXPECT_TRUE(store_->finish_upload(*ticket));
    return true;
  }
  bool has(const std::string& bytes, const std::string& owner) { return store_->belongs_to(sha256(bytes), owner); }

  std::filesystem::path folder_;
  std::unique_ptr<DirectoryMeshStore> store_;
};

TEST_F(DirectoryOwners, MustSendTheBytesThemselves) {
  EXPECT_TRUE(upload("mesh", "ann"));
  EXPECT_FALSE(upload("mesh", "ann"));
  EXPECT_FALSE(has("mesh", "bob"));
  EXPECT_FALSE(store_->query_upload("id", sha256("mesh"), "bob"));
  const auto ticket = store_->begin_upload("id", sha256("mesh"), 4, "bob");
  ASSERT_FALSE(ticket->complete);
  EXPECT_TRUE(store_->append(*ticket, 0, "MESH"));
  EXPECT_EQ(store_->finish_upload(*ticket).error().reason, "DIGEST_MISMATCH");
  EXPECT_FALSE(has("mesh", "bob")) << "other bytes prove nothing";
  EXPECT_TRUE(upload("mesh", "bob"));
  EXPECT_TRUE(has("mesh", "bob"));
  EXPECT_FALSE(upload("mesh", "")) << "a server that does not ask has it all";
}

TEST_F(DirectoryOwners, HaveUploadIdsOfTheirOwn) {
  const auto of_ann = store_->begin_upload("id", sha256("ann's"), 5, "ann");
  ASSERT_TRUE(store_->append(*of_ann, 0, "an"));
  const auto of_bob = store_->begin_upload("id", sha256("bob's"), 5, "bob");
  ASSERT_TRUE(of_bob) << "the id is not used";
  EXPECT_EQ(of_bob->committed, 0);
  EXPECT_TRUE(store_->append(*of_ann, 2, "n's")) << "nobody has taken it over";
  EXPECT_EQ(store_->query_upload("id", sha256("ann's"), "ann")->committed, 5);
  EXPECT_EQ(store_->query_upload("id", sha256("bob's"), "bob")->committed, 0);
  EXPECT_TRUE(store_->finish_upload(*of_ann));
}

TEST_F(DirectoryOwners, AreKnownToTheNextServer) {
  upload("one", "ann");
  upload("one", "bob");
  upload("two", "ann");
  const auto result = write(*store_, "result");
  store_->grant(result.digest, "ann");
  EXPECT_TRUE(has("result", "ann"));
  open();
  EXPECT_TRUE(has("one", "ann"));
  EXPECT_TRUE(has("one", "bob"));
  EXPECT_TRUE(has("two", "ann"));
  EXPECT_FALSE(has("two", "bob"));
  EXPECT_FALSE(has("result", "ann")) << "the jobs say so";
}

TEST_F(DirectoryOwners, GiveUpAMeshOneByOne) {
  upload("mesh", "ann");
  upload("mesh", "bob");
  EXPECT_EQ(store_->remove(sha256("mesh"), "carol").error().reason, "MESH_NOT_FOUND");
  EXPECT_TRUE(store_->remove(sha256("mesh"), "ann"));
  EXPECT_FALSE(has("mesh", "ann"));
  open();
  EXPECT_FALSE(has("mesh", "ann"));
  EXPECT_TRUE(has("mesh", "bob"));
  store_->retain(sha256("mesh"));
  EXPECT_TRUE(store_->remove(sha256("mesh"), "bob"));
  EXPECT_TRUE(has("mesh", "")) << "a job still reads it";
  store_->release(sha256("mesh"));
  EXPECT_FALSE(has("mesh", ""));
  EXPECT_TRUE(std::filesystem::is_empty(folder_)) << "the file of the owners is gone too";
}

TEST_F(DirectoryOwners, HaveAResultOnlyThroughTheirJobs) {
  const auto result = write(*store_, "result");
  store_->grant(result.digest, "ann");
  store_->grant(result.digest, "bob");
  store_->revoke(result.digest, "ann");
  EXPECT_FALSE(store_->belongs_to(result.digest, "ann"));
  EXPECT_TRUE(store_->belongs_to(result.digest, "bob"));
  upload("result", "ann");
  store_->grant(result.digest, "ann");
  store_->revoke(result.digest, "ann");
  EXPECT_TRUE(store_->belongs_to(result.digest, "ann")) << "what she has sent is hers";
  EXPECT_TRUE(store_->query_upload("", result.digest, "bob")->complete);
  store_->revoke(result.digest, "bob");
  EXPECT_TRUE(store_->belongs_to(result.digest, "bob")) << "he was told that he need not send it";
}

TEST_F(DirectoryOwners, AreNobodyAfterAFlippedBit) {
  upload("mesh", "ann");
  const auto path = folder_ / (sha256("mesh") + ".owners");
  std::string text;
  {
    std::ifstream file(path);
    std::getline(file, text);
  }
  ASSERT_EQ(text.size(), 64u);
  for (std::size_t byte = 0; byte < text.size(); ++byte) {
    std::string changed = text;
    changed[byte] ^= static_cast<char>(1U << (byte % 8));
    std::ofstream(path) << changed << "\n";
    open();
    for (const char* owner : {"ann", "bob", "anm"}) EXPECT_FALSE(has("mesh", owner)) << byte;
  }
  EXPECT_TRUE(upload("mesh", "ann")) << "she sends it again";
  open();
  EXPECT_TRUE(has("mesh", "ann"));
}

TEST_F(DirectoryOwners, LeaveNoFilesOfMeshesThatAreGone) {
  upload("mesh", "ann");
  std::filesystem::remove(folder_ / sha256("mesh"));
  open();
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
  std::filesystem::create_symlink("/etc/passwd", folder_ / (sha256("mesh") + ".owners"));
  EXPECT_TRUE(upload("mesh", "ann")) << "the link is replaced, not followed";
  open();
  EXPECT_TRUE(has("mesh", "ann"));
}

TEST(OwnersShare, BoundsWhatAnOwnerStores) {
  Time now{std::chrono::hours(1)};
  DirectoryMeshSettings settings = settings_with([&now] { return now; });
  settings.max_bytes_of_owner = 100;
  const auto store = std::move(*DirectoryMeshStore::create(::testing::TempDir(), settings));
  const auto begin = [&](const std::string& owner, const std::string& id, const std::string& bytes) {
    return store->begin_upload(id, sha256(bytes), static_cast<std::int64_t>(bytes.size()), owner);
  };
  const auto upload = [&](const std::string& owner, const std::string& bytes) -> std::string {
    const auto ticket = begin(owner, sha256(bytes), bytes);
    if (!ticket) return ticket.error().reason;
    if (ticket->complete) return "complete";
    EXPECT_TRUE(store->append(*ticket, 0, bytes));
    return store->finish_upload(*ticket) ? "stored" : "failed";
  };
  const std::string forty(40, 'a'), fifty(50, 'b'), eleven(11, 'c');
  EXPECT_EQ(upload("ann", forty), "stored");
  EXPECT_EQ(upload("ann", fifty), "stored");
  EXPECT_EQ(upload("ann", eleven), "OWNER_FULL");
  EXPECT_EQ(upload("ann", forty), "complete") << "what she has needs no more room";
  EXPECT_EQ(upload("bob", forty), "stored") << "the same mesh counts for both";
  EXPECT_EQ(upload("", std::string(500, 'd')), "stored") << "a server that does not ask knows no owners";
  EXPECT_TRUE(store->check_share("ann", 10));
  EXPECT_FALSE(store->check_share("ann", 11));

  EXPECT_TRUE(store->remove(sha256(forty), "ann"));
  EXPECT_EQ(upload("ann", eleven), "OWNER_FULL") << "she was counted a moment ago";
  now += std::chrono::seconds(1);
  EXPECT_EQ(upload("ann", eleven), "stored");

  const auto begun = begin("ann", "cut", std::string(39, 'e'));
  ASSERT_TRUE(begun);
  now += std::chrono::seconds(1);
  EXPECT_EQ(upload("ann", "x"), "OWNER_FULL") << "uploads that have begun count with all their bytes";
  EXPECT_TRUE(begin("ann", "cut", std::string(39, 'e'))) << "and can be continued";
  now += kUploadLifetime + std::chrono::seconds(1);
  store->sweep();
  EXPECT_EQ(upload("ann", "x"), "stored");

  const StoredBytes result = write(*store, std::string(200, 'r'));
  store->grant(result.digest, "ann");
  EXPECT_FALSE(store->check_share("ann", 0)) << "results are kept, and nothing else is taken";
  store->release(result.digest);
  now += std::chrono::seconds(1);
  EXPECT_TRUE(store->check_share("ann", 0));
}

}  // namespace
}  // namespace varimesh::server::testing
