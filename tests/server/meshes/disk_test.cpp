// What clients say about their uploads, and names of directories.
#include "server/meshes/disk.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
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

TEST(PartWriter, TakesAPieceAgainThatTheDiskTookInPart) {
  std::string path = ::testing::TempDir() + "varimesh-part-XXXXXX";
  const int file = ::mkstemp(path.data());
  ASSERT_GE(file, 0);
  PartWriter writer(
      file, path, std::nullopt, [] { return true; },
      [](const std::filesystem::path&, int, StoredBytes stored) -> Answer<StoredBytes> { return stored; });
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  EXPECT_TRUE(writer.append("begin "));
  const rlimit small{10, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  EXPECT_FALSE(writer.append("middle ")) << "four of its bytes fit";
  EXPECT_EQ(std::filesystem::file_size(path), 6U) << "they take no room until the piece comes again";
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_TRUE(writer.append("middle "));
  EXPECT_TRUE(writer.append("end"));
  std::ifstream written(path);
  std::string text;
  std::getline(written, text);
  EXPECT_EQ(text, "begin middle end");
  const auto stored = writer.commit();
  ASSERT_TRUE(stored);
  EXPECT_EQ(stored->digest, sha256(text));
  EXPECT_EQ(stored->size, 16);
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
