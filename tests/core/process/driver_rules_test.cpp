// What a process may do that has a graphics card. There is none here, so the tests ask for what a driver would.
#include "core/process/driver_rules.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "core/process/landlock.h"
#include "tests/core/process/behind_the_filter.h"

namespace varimesh {
namespace {

using testing::refused;

bool has_landlock() { return ::syscall(444, nullptr, 0, 1) >= 1; }

/// As behind_the_filter(), with the rights of a process that has a card.
int with_a_card(
    const std::function<int()>& work, Confinement keeps = {},
    const std::function<bool()>& before = [] { return true; }) {
  keeps.threads = keeps.has_threads = keeps.has_device = true;
  return testing::behind_the_filter(work, keeps, [&] { return open_only_files_of_the_driver() && before(); });
}

class WithACard : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!has_landlock()) GTEST_SKIP() << "this system has no Landlock";
  }
};

TEST_F(WithACard, StillRefusesWhatAJobMustNotDo) {
  const std::string parent = "/proc/" + std::to_string(::getpid());
  for (const std::string& path : {std::string("/etc/passwd"), parent + "/environ", parent + "/mem", parent + "/cmdline",
                                  std::string("/dev/null"), std::string("/tmp")})
    EXPECT_EQ(with_a_card([&] { return refused(::open(path.c_str(), O_RDONLY), EACCES); }), 0) << path;
  EXPECT_EQ(with_a_card([] { return refused(::open("/tmp/varimesh", O_CREAT | O_WRONLY, 0600), EACCES); }), 0);
  EXPECT_EQ(with_a_card([] { return refused(::open("/proc/self/oom_score_adj", O_WRONLY), EACCES); }), 0);
  EXPECT_EQ(with_a_card([] { return refused(::unlink("/tmp/varimesh")); }), 0);
  EXPECT_EQ(with_a_card([] { return refused(::socket(AF_INET, SOCK_STREAM, 0)); }), 0);
  EXPECT_EQ(with_a_card([] { return refused(::socket(AF_UNIX, SOCK_STREAM, 0)); }), 0);
  EXPECT_EQ(with_a_card([] { return refused(::fork()); }), 0);
  EXPECT_EQ(with_a_card([] { return refused(::execl("/bin/true", "true", nullptr)); }), 0);
  EXPECT_EQ(with_a_card([] { return refused(::kill(::getppid(), 0)); }), 0);
  EXPECT_EQ(with_a_card([] { return refused(::syscall(SYS_memfd_create, "test", 0)); }), 0);
  EXPECT_EQ(with_a_card([] {
              const int all = PROT_READ | PROT_WRITE | PROT_EXEC;
              return ::mmap(nullptr, 4096, all, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED ? 0 : 1;
            }),
            0);
}

TEST_F(WithACard, RefusesCommandsThatAreNotTheDrivers) {
  constexpr unsigned long kSignalOwner = 0x8901, kTypeIntoTerminal = 0x5412;
  for (const unsigned long command : {kSignalOwner, kTypeIntoTerminal}) {
    int number = 1;
    EXPECT_EQ(with_a_card([&] { return refused(::ioctl(0, command, &number)); }), 0) << command;
  }
  EXPECT_EQ(with_a_card([] { return refused(::fcntl(0, F_SETOWN, 1)); }), 0);
  EXPECT_EQ(with_a_card([] { return ::fcntl(0, F_GETFD) >= 0 ? 0 : 1; }), 0);
  // What is open here knows none of the driver's commands, but it is asked.
  constexpr unsigned long kOfDriver = 0xc020462a, kOfManagedMemory = 37, kFirstOfManagedMemory = 0x30000001;
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
  for (const unsigned long command : {kOfDriver, kOfManagedMemory, kFirstOfManagedMemory})
    EXPECT_EQ(with_a_card([&] { return ::ioctl(ends[0], command, nullptr) < 0 && errno != EPERM ? 0 : 1; }), 0)
        << command;
  for (const int end : ends) ::close(end);
}

TEST_F(WithACard, OpensWhatADriverLooksAt) {
  for (const char* path : {"/proc/self/status", "/proc/devices", "/proc/meminfo", "/sys", "/usr/lib"})
    EXPECT_EQ(with_a_card([&] { return ::open(path, O_RDONLY) >= 0 ? 0 : 1; }), 0) << path;
  struct stat status {};
  EXPECT_EQ(with_a_card([&] { return ::stat("/dev/null", &status); }), 0);
  int ends[2];
  EXPECT_EQ(with_a_card([&] { return ::pipe2(ends, O_CLOEXEC); }), 0);
}

TEST_F(WithACard, HoldsTheThreadsThatADriverHasStarted) {
  std::atomic<bool> confined = false;
  std::atomic<int> outcome = -1;
  EXPECT_EQ(with_a_card(
                [&] {
                  confined = true;
                  while (outcome < 0) std::this_thread::yield();
                  return outcome.load();
                },
                {},
                [&] {
                  std::thread([&] {
                    while (!confined) std::this_thread::yield();
                    outcome = refused(::open("/etc/passwd", O_RDONLY), EACCES) +
                              refused(::socket(AF_INET, SOCK_STREAM, 0)) + refused(::fork());
                  }).detach();
                  return true;
                }),
            0);
}

TEST_F(WithACard, CountsMemoryAndNotAddresses) {
  const Confinement keeps{.memory = 512 << 20};
  EXPECT_EQ(with_a_card(
                [] {
                  constexpr std::size_t kMuch = std::size_t{1} << 44;
                  constexpr int kReserves = MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE;
                  char* const reserved = static_cast<char*>(::mmap(nullptr, kMuch, PROT_NONE, kReserves, -1, 0));
                  if (reserved == MAP_FAILED) return 1;
                  return ::mprotect(reserved, std::size_t{1} << 30, PROT_READ | PROT_WRITE) == 0 ? 2 : 0;
                },
                keeps),
            0)
      << "a driver reserves addresses, and nobody writes to more than the limit";
  EXPECT_EQ(with_a_card([] { return std::malloc(std::size_t{1} << 30) == nullptr ? 0 : 1; }, keeps), 0);
  EXPECT_EQ(with_a_card([] { return std::malloc(std::size_t{1} << 24) != nullptr ? 0 : 1; }, keeps), 0);
}

TEST_F(WithACard, OpensOnlyTheFilesThatAreNamed) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(::testing::TempDir()) / ("landlock" + std::to_string(::getpid()));
  fs::create_directories(folder / "read");
  for (const char* name : {"read/one", "used", "other"}) std::ofstream(folder / name) << name;
  const auto opens = [&](const char* name, int how) {
    return testing::behind_the_filter([] { return 0; }, {},
                                      [&] {
                                        return open_only({{folder / "read", folder / "nowhere"}, {folder / "used"}}) &&
                                               ::open((folder / name).c_str(), how) >= 0;
                                      });
  };
  EXPECT_EQ(opens("read/one", O_RDONLY), 0);
  EXPECT_EQ(opens("read/one", O_RDWR), 98);
  EXPECT_EQ(opens("used", O_RDWR), 0);
  EXPECT_EQ(opens("other", O_RDONLY), 98);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace varimesh
