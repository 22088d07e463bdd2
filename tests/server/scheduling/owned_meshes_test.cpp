// Which meshes belong to an owner through jobs.
#include "server/scheduling/owned_meshes.h"

#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {
namespace {

class OwnedMeshesTest : public ::testing::Test {
 protected:
  bool belongs_to_ann() { return store_->belongs_to(digest_, "ann"); }

  std::unique_ptr<DirectoryMeshStore> store_ = new_store();
  OwnedMeshes owned_{*store_};
  const std::string digest_ = write(*store_, "mesh").digest;
};

TEST_F(OwnedMeshesTest, BelongToTheOwnerUntilTheLastJobIsGone) {
  owned_.add("ann", {digest_});
  owned_.add("ann", {digest_});
  owned_.add("bob", {digest_});
  owned_.remove("ann", {digest_});
  EXPECT_TRUE(owned_.has("ann", digest_));
  EXPECT_TRUE(belongs_to_ann());
  owned_.remove("ann", {digest_});
  EXPECT_FALSE(owned_.has("ann", digest_));
  EXPECT_FALSE(belongs_to_ann());
  EXPECT_TRUE(store_->belongs_to(digest_, "bob"));
}

TEST_F(OwnedMeshesTest, StayWithACallThatSubmitsWhileAnotherIsRefused) {
  // Two calls have sent the mesh. One is refused before the other's job has it.
  owned_.add("ann", {digest_});
  owned_.add("ann", {digest_});
  owned_.remove("ann", {digest_});
  EXPECT_TRUE(belongs_to_ann()) << "the other call's job would be refused, as if the mesh were not there";
  owned_.remove("ann", {digest_});
  EXPECT_FALSE(belongs_to_ann());
  owned_.remove("ann", {digest_});
  EXPECT_FALSE(owned_.has("ann", digest_)) << "removing what is not there changes nothing";
}

}  // namespace
}  // namespace varimesh::server::testing
