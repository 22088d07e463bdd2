// A file that is written as a whole or not at all: links, mounts, devices and long names.
#include "core/base/io/output_file.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using test::Folder;

std::size_t files_in(const std::string& folder) {
  return std::size_t(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(OutputFile, FollowsLinksAndKeepsRights) {
  const Folder folder;
  std::ofstream(folder.file("real")) << "old";
  std::filesystem::permissions(folder.file("real"), std::filesystem::perms(0640));
  std::filesystem::create_symlink("real", folder.file("second"));
  std::filesystem::create_symlink(folder.file("second"), folder.file("first"));
  auto file = OutputFile::open(folder.file("first"));
  ASSERT_TRUE(file) << file.error().sentence;
  EXPECT_TRUE(file->write("new"));
  EXPECT_EQ(test::slurp(folder.file("real")), "old");
  ASSERT_TRUE(file->commit());
  EXPECT_EQ(test::slurp(folder.file("real")), "new");
  EXPECT_EQ(std::filesystem::status(folder.file("real")).permissions(), std::filesystem::perms(0640));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.file("first")) && std::filesystem::is_symlink(folder.file("second")));
  EXPECT_EQ(files_in(folder.path()), 3u);
}

TEST(OutputFile, WritesOverWhatIsMountedOnTheName) {
  const Folder folder;
  std::ofstream(folder.file("mounted")) << "something longer that was there";
  std::ofstream(folder.file("name"));
  constexpr int kNotAllowed = 77;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    // The child has its own mount table, so nothing needs to be unmounted.
    if (::unshare(CLONE_NEWNS) != 0 || ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        ::mount(folder.file("mounted").c_str(), folder.file("name").c_str(), nullptr, MS_BIND, nullptr) != 0)
      ::_exit(kNotAllowed);
    auto file = OutputFile::open(folder.file("name"));
    ::_exit(file && file->write("new") && file->commit() ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == kNotAllowed) GTEST_SKIP() << "only root can mount here";
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(test::slurp(folder.file("mounted")), "new");
}

TEST(OutputFile, LinksInARingAreRefused) {
  const Folder folder;
  std::filesystem::create_symlink("b", folder.file("a"));
  std::filesystem::create_symlink("a", folder.file("b"));
  EXPECT_FALSE(OutputFile::open(folder.file("a")));
}

TEST(OutputFile, AFullDeviceIsAnOutputError) {
  auto file = OutputFile::open("/dev/full");
  ASSERT_TRUE(file) << file.error().sentence;
  EXPECT_FALSE(file->write("some"));
  const auto done = file->commit();
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().kind, Error::Kind::Output);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(OutputFile, ALongNameIsNoObstacle) {
  const Folder folder;
  const std::string name = std::string(251, 'a') + ".msh";
  auto file = OutputFile::open(folder.file(name));
  ASSERT_TRUE(file) << file.error().sentence;
  ASSERT_TRUE(file->commit());
  EXPECT_TRUE(std::filesystem::exists(folder.file(name)));
}

}  // namespace
}  // namespace varimesh
