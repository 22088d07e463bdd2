// What a process may still do behind the filter. Each test is a child of this program, which has one thread.
#include "core/process/sandbox.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <thread>
#include <vector>

namespace varimesh {
namespace {

/// Runs `work` in a child behind the filter. Returns its exit status: `work` returns it; 99 without a filter.
int behind_the_filter(const std::function<int()>& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit no_core{0, 0};
    ::setrlimit(RLIMIT_CORE, &no_core);
    ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
    if (!use_only_open_files()) ::_exit(99);
    ::_exit(work());
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

/// 0 if the call was refused with EPERM.
template <class Result>
int refused(Result result) {
  return result < 0 && errno == EPERM ? 0 : 1;
}

TEST(Sandbox, RefusesFilesSocketsProgramsAndSignals) {
  EXPECT_EQ(behind_the_filter([] { return refused(::open("/etc/passwd", O_RDONLY)); }), 0);
  EXPECT_EQ(behind_the_filter([] { return refused(::open("/tmp/varimesh", O_CREAT | O_WRONLY, 0600)); }), 0);
  EXPECT_EQ(behind_the_filter([] { return refused(::unlink("/tmp/varimesh")); }), 0);
  EXPECT_EQ(behind_the_filter([] { return refused(::socket(AF_INET, SOCK_STREAM, 0)); }), 0);
  EXPECT_EQ(behind_the_filter([] { return refused(::socket(AF_UNIX, SOCK_STREAM, 0)); }), 0);
  EXPECT_EQ(behind_the_filter([] { return refused(::fork()); }), 0);
  EXPECT_EQ(behind_the_filter([] { return refused(::execl("/bin/true", "true", nullptr)); }), 0);
  EXPECT_EQ(behind_the_filter([] { return refused(::kill(::getppid(), 0)); }), 0);
  EXPECT_EQ(behind_the_filter([] { return refused(::fcntl(0, F_SETOWN, 1)); }), 0);
}

TEST(Sandbox, RefusesCodeAndHigherLimits) {
  EXPECT_EQ(behind_the_filter([] {
              const int all = PROT_READ | PROT_WRITE | PROT_EXEC;
              return ::mmap(nullptr, 4096, all, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED ? 0 : 1;
            }),
            0);
  EXPECT_EQ(behind_the_filter([] {
              const rlimit more{RLIM_INFINITY, RLIM_INFINITY};
              return refused(::setrlimit(RLIMIT_AS, &more));
            }),
            0);
  EXPECT_EQ(behind_the_filter([] {
              rlimit now{};
              return ::getrlimit(RLIMIT_AS, &now);
            }),
            0);
}

TEST(Sandbox, LeavesThreadsMemoryAndWhatIsOpen) {
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
  EXPECT_EQ(behind_the_filter([&] {
              int sum = 0;
              std::thread([&] {
                std::vector<double> large(10'000'000, 1.0);
                sum = static_cast<int>(large[9'999'999]);
              }).join();
              const int memory = ::memfd_create("test", MFD_CLOEXEC);
              const bool writes = memory >= 0 && ::write(memory, "x", 1) == 1 && ::write(ends[1], "y", 1) == 1;
              return sum == 1 && writes ? 0 : 1;
            }),
            0);
  char byte = 0;
  EXPECT_EQ(::read(ends[0], &byte, 1), 1);
  EXPECT_EQ(byte, 'y');
  for (const int end : ends) ::close(end);
}

TEST(Sandbox, LetsAProcessAbort) {
  EXPECT_EQ(behind_the_filter([]() -> int { std::abort(); }), 1000 + SIGABRT);
}

}  // namespace
}  // namespace varimesh
