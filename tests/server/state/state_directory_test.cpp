// The lock and the permissions of the state directory.
#include "server/state/state_directory.h"

#include <gtest/gtest.h>

#include <fstream>

namespace varimesh::server {
namespace {

class StateDirectoryTest : public ::testing::Test {
 protected:
  StateDirectoryTest() {
    std::string name = ::testing::TempDir() + "varimesh-state-XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~StateDirectoryTest() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_;
};

TEST_F(StateDirectoryTest, IsCreatedForItsOwner) {
  const auto taken = StateDirectory::take((folder_ / "deep" / "state/").string());
  ASSERT_TRUE(taken) << taken.error().sentence;
  EXPECT_EQ(std::filesystem::status(folder_ / "deep" / "state").permissions(), std::filesystem::perms::owner_all);
  EXPECT_EQ((*taken)->jobs(), (folder_ / "deep" / "state" / "jobs.sqlite").string());
}

TEST_F(StateDirectoryTest, HasOneOwnerAtATime) {
  {
    const auto first = StateDirectory::take(folder_.string());
    ASSERT_TRUE(first);
    const auto second = StateDirectory::take(folder_.string());
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().kind, Error::Kind::Output);
    EXPECT_NE(second.error().sentence.find("another varimeshd"), std::string::npos) << second.error().sentence;
  }
  EXPECT_TRUE(StateDirectory::take(folder_.string())) << "the first owner has released it";
}

TEST_F(StateDirectoryTest, CannotBeInsideAFile) {
  std::ofstream(folder_ / "file") << "text";
  const auto taken = StateDirectory::take((folder_ / "file" / "state").string());
  ASSERT_FALSE(taken);
  EXPECT_NE(taken.error().sentence.find("--state"), std::string::npos) << taken.error().sentence;
}

}  // namespace
}  // namespace varimesh::server
