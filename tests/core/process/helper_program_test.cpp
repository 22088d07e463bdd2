// Programs that VariMesh starts: where they are found, and what they have.
#include "core/process/helper_program.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

/// Starts a script of the shell with the files, and returns its exit status.
int run(const std::string& script, std::span<const int> files, std::vector<std::string> environment = {}) {
  const Helper helper = start_helper({"/bin/sh", {"-c", script}, files, std::move(environment)});
  EXPECT_GT(helper.id, 0) << helper.error;
  const int status = end_helper(helper.id, false);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

TEST(FindHelper, TakesTheVariableFirst) {
  const test::Folder folder;
  const std::string file = folder.file("program");
  std::ofstream(file) << "#!/bin/sh\n";
  ::setenv("VARIMESH_TEST_HELPER", file.c_str(), 1);
  EXPECT_EQ(find_helper("core_process_tests", "VARIMESH_TEST_HELPER"), file);
  ::setenv("VARIMESH_TEST_HELPER", "/nowhere", 1);
  EXPECT_EQ(find_helper("core_process_tests", "VARIMESH_TEST_HELPER"), "");
  ::unsetenv("VARIMESH_TEST_HELPER");
  const std::string beside = find_helper("core_process_tests", "VARIMESH_TEST_HELPER");
  EXPECT_EQ(std::filesystem::path(beside).filename(), "core_process_tests");
  EXPECT_EQ(find_helper("no such program", "VARIMESH_TEST_HELPER"), "");
}

TEST(Helper, HasTheFilesAndNoOthers) {
  int first[2], second[2];
  // As all files of this process, they are closed when a program starts.
  ASSERT_EQ(::pipe2(first, O_CLOEXEC), 0);
  ASSERT_EQ(::pipe2(second, O_CLOEXEC), 0);
  // Each pipe's end becomes the other's number, if none takes care.
  const int files[] = {second[1], first[1]};
  EXPECT_EQ(
      run("echo a >&3; echo b >&4; for n in 5 6 7 8 9; do [ -e /proc/self/fd/$n ] && exit 1; done; exit 7", files), 7);
  char byte = 0;
  EXPECT_EQ(::read(second[0], &byte, 1), 1);
  EXPECT_EQ(byte, 'a');
  EXPECT_EQ(::read(first[0], &byte, 1), 1);
  EXPECT_EQ(byte, 'b');
  for (const int end : {first[0], first[1], second[0], second[1]}) ::close(end);
}

TEST(Helper, HasNoSecretsOfTheEnvironment) {
  ::setenv("VARIMESH_TOKEN", "secret", 1);
  EXPECT_EQ(run("[ -z \"$VARIMESH_TOKEN\" ] && [ \"$GIVEN\" = yes ]", {}, {"GIVEN=yes"}), 0);
  ::unsetenv("VARIMESH_TOKEN");
}

TEST(Helper, HasAProcessGroupOfItsOwn) {
  const Helper helper = start_helper({"/bin/sleep", {"100"}, {}});
  ASSERT_GT(helper.id, 0);
  EXPECT_EQ(::getpgid(helper.id), helper.id);
  const int status = end_helper(helper.id, true);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
}

TEST(Helper, ThatIsNotThereIsNotStarted) {
  const Helper helper = start_helper({"/nowhere/program", {}, {}});
  EXPECT_EQ(helper.id, -1);
  EXPECT_EQ(helper.error, ENOENT);
}

}  // namespace
}  // namespace varimesh
