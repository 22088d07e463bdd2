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

}  // namespace
}  // namespace varimesh::server::testing
