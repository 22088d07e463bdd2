#include "client/library/input_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "client/client.h"
#include "client/process/temporary_folder.h"

namespace varimesh::client {
namespace {

TEST(InputFile, ReadsFromAnyOffset) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "file";
  std::ofstream(path) << "0123456789";
  const auto file = InputFile::open(path);
  ASSERT_TRUE(file);
  EXPECT_EQ(file->read(4, 3), "456");
  EXPECT_EQ(file->read(0, 2), "01");
  EXPECT_EQ(file->read(8, 5), "89");
  EXPECT_EQ(file->read(20, 5), "");
}

TEST(InputFile, APipeCanBeReadTwice) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  std::thread writer([&] { std::ofstream(path) << "from a pipe"; });
  const auto file = InputFile::open(path);
  writer.join();
  ASSERT_TRUE(file);
  EXPECT_EQ(file->read(0, 100), "from a pipe");
  EXPECT_EQ(file->read(7, 100), "pipe");
}

TEST(InputFile, WaitingForAPipeCanBeInterrupted) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  const int keeps_it_open = ::open(path.c_str(), O_RDWR);
  const auto file = InputFile::open(path, [] { return true; });
  ::close(keeps_it_open);
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().kind, Failure::Kind::Interrupted);
}

TEST(InputFile, AMissingFileAndAFolderAreRefusedByName) {
  const TemporaryFolder folder;
  for (const std::string& path : {std::string(folder.path() / "missing"), folder.path().string()}) {
    const auto file = InputFile::open(path);
    ASSERT_FALSE(file) << path;
    EXPECT_EQ(file.error().kind, Failure::Kind::File);
    EXPECT_NE(file.error().sentence.find(path), std::string::npos) << file.error().sentence;
  }
}

TEST(InputFile, ATemporaryFileTakesBytes) {
  auto file = InputFile::temporary("a name");
  ASSERT_TRUE(file);
  EXPECT_TRUE(file->append("one "));
  EXPECT_TRUE(file->append("two"));
  EXPECT_EQ(file->read(0, 100), "one two");
}

TEST(InputFile, ReadWholeReturnsAllBytes) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "file";
  const std::string bytes(1'000'000, 'x');
  std::ofstream(path) << bytes;
  EXPECT_EQ(read_whole(path), bytes);
}

}  // namespace
}  // namespace varimesh::client
