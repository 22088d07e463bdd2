// What a process may still do behind the filter. Each test is a child of this program, which has one thread.
#include "core/process/sandbox.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "tests/core/process/behind_the_filter.h"

namespace varimesh {
namespace {

using testing::behind_the_filter;
using testing::refused;

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

TEST(Sandbox, RefusesNamesBesideAnOpenFile) {
  EXPECT_EQ(behind_the_filter([] {
              struct stat status {};
              return ::fstat(0, &status) == 0 && S_ISREG(status.st_mode) == 0 ? 0 : 1;
            }),
            0)
      << "the library asks for it by an empty name";
  struct stat status {};
  EXPECT_EQ(behind_the_filter([&] { return refused(::stat("/etc/passwd", &status)); }), 0);
  EXPECT_EQ(behind_the_filter([&] { return refused(::fstatat(0, "/etc/passwd", &status, AT_EMPTY_PATH)); }), 0);
}

TEST(Sandbox, RefusesMemoryAndThreadsBeyondTheLimits) {
  EXPECT_EQ(behind_the_filter([] { return refused(::syscall(SYS_memfd_create, "test", 0)); }), 0);
  EXPECT_EQ(
      behind_the_filter(
          [] { return ::mmap(nullptr, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED ? 0 : 1; },
          {.memory = 1 << 20}),
      0);
  EXPECT_EQ(behind_the_filter([] {
              try {
                std::thread([] {}).join();
              } catch (const std::system_error&) {
                return 0;
              }
              return 1;
            }),
            0);
  const int file = ::memfd_create("test", MFD_CLOEXEC);
  const auto writes = [file] { return ::write(file, "four", 4) == 4 && ::write(file, "more", 4) == 4 ? 1 : 2; };
  EXPECT_EQ(behind_the_filter(writes, {.file_bytes = 6}), 2);
  EXPECT_EQ(behind_the_filter(writes, {.file_bytes = 4}), 1000 + SIGXFSZ);
  ::close(file);
}

TEST(Sandbox, OpensTheOneFileThatItMay) {
  const int file = ::memfd_create("test", MFD_CLOEXEC);
  ASSERT_EQ(::write(file, "content", 7), 7);
  const std::string path = "/proc/self/fd/" + std::to_string(file);
  const Confinement keeps{.more_descriptors = 1, .path = path.c_str(), .file = file};
  EXPECT_EQ(
      behind_the_filter(
          [&] {
            char bytes[8] = "";
            const int opened = ::open(path.c_str(), O_RDONLY);
            return ::read(opened, bytes, 7) == 7 && std::strcmp(bytes, "content") == 0 && ::close(opened) == 0 ? 0 : 1;
          },
          keeps),
      0);
  EXPECT_EQ(behind_the_filter([&] { return refused(::open(path.c_str(), O_RDWR)); }, keeps), 0);
  EXPECT_EQ(behind_the_filter([] { return refused(::open("/etc/passwd", O_RDONLY)); }, keeps), 0);
  EXPECT_EQ(behind_the_filter(
                [&] { return ::open(path.c_str(), O_RDONLY), ::open(path.c_str(), O_RDONLY) < 0 ? 0 : 1; }, keeps),
            0)
      << "one descriptor more";
  ::close(file);
}

TEST(Sandbox, LeavesThreadsMemoryAndWhatIsOpen) {
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
  EXPECT_EQ(behind_the_filter(
                [&] {
                  int sum = 0;
                  std::thread([&] {
                    std::vector<double> large(10'000'000, 1.0);
                    sum = static_cast<int>(large[9'999'999]);
                  }).join();
                  return sum == 1 && ::write(ends[1], "y", 1) == 1 ? 0 : 1;
                },
                {.threads = true}),
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
