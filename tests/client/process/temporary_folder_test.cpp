#include "client/process/temporary_folder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

namespace varimesh::client {
namespace {

TEST(TemporaryFolder, IsRemovedWithItsContent) {
  std::filesystem::path path;
  {
    const TemporaryFolder folder;
    path = folder.path();
    std::filesystem::create_directory(path / "inner");
    std::ofstream(path / "inner" / "file") << "content";
  }
  EXPECT_FALSE(path.empty());
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(TemporaryFolder, IsEmptyIfNoneCanBeMade) {
  setenv("TMPDIR", "/proc", 1);
  const TemporaryFolder folder;
  unsetenv("TMPDIR");
  EXPECT_TRUE(folder.path().empty());
}

TEST(TemporaryFolderDeathTest, IsRemovedBeforeTheProcessEndsAtOnce) {
  const std::filesystem::path parent = std::filesystem::temp_directory_path() / "varimesh-test-XXXXXX";
  std::string name = parent;
  ASSERT_NE(mkdtemp(name.data()), nullptr);
  EXPECT_EXIT(
      {
        setenv("TMPDIR", name.c_str(), 1);
        const TemporaryFolder folder;
        std::ofstream(folder.path() / "file") << "content";
        remove_temporary_files();
        _exit(7);
      },
      testing::ExitedWithCode(7), "");
  EXPECT_TRUE(std::filesystem::is_empty(name));
  std::filesystem::remove_all(name);
}

}  // namespace
}  // namespace varimesh::client
