// The lock and the permissions of the state directory.
#include "server/state/state_directory.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

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

TEST_F(StateDirectoryTest, HasOneOwnerAlsoWithoutItsLockFile) {
  const auto first = StateDirectory::take(folder_.string());
  ASSERT_TRUE(first);
  std::filesystem::remove(folder_ / "lock");
  const auto second = StateDirectory::take(folder_.string());
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().sentence.find("another varimeshd"), std::string::npos) << second.error().sentence;
}

TEST_F(StateDirectoryTest, MustNotBeWritableByOthers) {
  for (const mode_t mode : {0720, 0702, 0777, 01777}) {
    ASSERT_EQ(::chmod(folder_.c_str(), mode), 0);
    const auto taken = StateDirectory::take(folder_.string());
    ASSERT_FALSE(taken) << mode;
    EXPECT_NE(taken.error().sentence.find("other users can write"), std::string::npos) << taken.error().sentence;
  }
  ASSERT_EQ(::chmod(folder_.c_str(), 0755), 0);
  EXPECT_TRUE(StateDirectory::take(folder_.string()));
}

TEST_F(StateDirectoryTest, MustBelongToTheUser) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a directory to another user";
  ASSERT_EQ(::chown(folder_.c_str(), 65532, 65532), 0);
  const auto taken = StateDirectory::take(folder_.string());
  ASSERT_FALSE(taken);
  EXPECT_NE(taken.error().sentence.find("belongs to another user (uid 65532"), std::string::npos)
      << taken.error().sentence;
}

TEST_F(StateDirectoryTest, LeadsThroughNoLinks) {
  const std::filesystem::path elsewhere = folder_ / "elsewhere";
  std::filesystem::create_directory(elsewhere);
  for (const char* name : {"meshes", "lock"}) {
    const std::filesystem::path state = folder_ / (std::string("with-") + name);
    ASSERT_TRUE(StateDirectory::take(state.string()));
    std::filesystem::remove(state / name);
    std::filesystem::create_symlink(elsewhere / name, state / name);
    if (name == std::string("meshes")) std::filesystem::create_directory(elsewhere / name);
    const auto taken = StateDirectory::take(state.string());
    ASSERT_FALSE(taken) << name;
    EXPECT_NE(taken.error().sentence.find("symbolic link"), std::string::npos) << taken.error().sentence;
  }
  EXPECT_FALSE(std::filesystem::exists(elsewhere / "lock"));
  // Whoever starts the server may name the directory by a link.
  std::filesystem::create_symlink(elsewhere, folder_ / "link");
  const auto taken = StateDirectory::take((folder_ / "link").string());
  ASSERT_TRUE(taken) << taken.error().sentence;
  EXPECT_EQ((*taken)->jobs(), (elsewhere / "jobs.sqlite").string()) << "SQLite refuses links";
}

TEST_F(StateDirectoryTest, CannotBeInsideAFile) {
  std::ofstream(folder_ / "file") << "text";
  const auto taken = StateDirectory::take((folder_ / "file" / "state").string());
  ASSERT_FALSE(taken);
  EXPECT_NE(taken.error().sentence.find("--state"), std::string::npos) << taken.error().sentence;
}

}  // namespace
}  // namespace varimesh::server
