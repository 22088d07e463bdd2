// What clients say about their uploads, and names of directories.
#include "server/meshes/disk.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <thread>

namespace varimesh::server::testing {
namespace {

TEST(SizeOfAMesh, IsCheckedBeforeAnySumIsMadeWithIt) {
  for (const std::int64_t negative : {std::int64_t{-1}, std::numeric_limits<std::int64_t>::min()}) {
    const auto checked = check_size(negative, 1 << 20, 0);
    ASSERT_FALSE(checked);
    EXPECT_EQ(checked.error().reason, "BAD_REQUEST");
    EXPECT_FALSE(check_upload("id", std::string(64, 'a'), negative, 1 << 20, 0));
  }
  EXPECT_EQ(check_size((1 << 20) + 1, 1 << 20, 0).error().reason, "MESH_TOO_LARGE");
  EXPECT_EQ(check_size(1 << 20, 1 << 20, 10).error().reason, "MESH_TOO_LARGE");
  EXPECT_TRUE(check_size(1 << 20, 1 << 20, 0));
  EXPECT_TRUE(check_size(0, 1 << 20, 1 << 30));
}

class NameOfDirectory : public ::testing::Test {
 protected:
  NameOfDirectory() {
    std::string name = ::testing::TempDir() + "varimesh-name-XXXXXX";
    directory_ = ::mkdtemp(name.data());
  }
  ~NameOfDirectory() override { std::filesystem::remove_all(directory_); }
  std::filesystem::path directory_;
};

TEST_F(NameOfDirectory, StaysAndIsTheSameForAllWhoAskAtTheSameTime) {
  std::vector<std::string> names(8);
  std::vector<std::thread> askers;
  for (std::string& name : names) askers.emplace_back([&] { name = *name_of_directory(directory_); });
  for (std::thread& asker : askers) asker.join();
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), 1U);
  EXPECT_EQ(*name_of_directory(directory_), names[0]);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_), {}), 1);
}

TEST_F(NameOfDirectory, IsNotReplacedIfItsFileIsDamaged) {
  std::ofstream(directory_ / "name") << "half a na";
  const auto name = name_of_directory(directory_);
  ASSERT_FALSE(name);
  EXPECT_NE(name.error().sentence.find("restore it"), std::string::npos) << name.error().sentence;
}

}  // namespace
}  // namespace varimesh::server::testing
