// What code does that has captured a program which reads strangers' bytes. captured_program preloads this library into
// the real program. As soon as the program has entered its sandbox, the library tries what a captured process would
// try, and writes into CAPTURED_REPORT, which it has mapped before, a line for each try: its name, and 'refused' or
// 'THROUGH'. Then the program goes on as if nothing had happened.
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <string>

namespace {

constexpr std::size_t kReportBytes = 1 << 16;
char* report = nullptr;
std::size_t written = 0;
pid_t parent = 0;

void tell(const char* name, bool through) {
  written += static_cast<std::size_t>(
      std::snprintf(report + written, kReportBytes - written, "%s %s\n", name, through ? "THROUGH" : "refused"));
}

/// A thread that sleeps. Its stack is part of one that all have together, so it takes no address space.
int sleeps(void*) {
  for (;;) ::syscall(SYS_nanosleep, std::begin({10L, 0L}), nullptr);
}

int threads_started(int most) {
  constexpr int kFlags = CLONE_VM | CLONE_FS | CLONE_FILES | CLONE_SIGHAND | CLONE_THREAD | CLONE_SYSVSEM;
  constexpr std::size_t kStack = 4096;
  char* const stacks = static_cast<char*>(std::malloc(kStack * static_cast<std::size_t>(most)));
  int count = 0;
  while (stacks != nullptr && count < most && ::clone(sleeps, stacks + kStack * (count + 1), kFlags, nullptr) >= 0)
    ++count;
  return count;
}

void try_files() {
  char path[64];
  for (const char* name : {"environ", "mem", "maps", "fd/0", "cmdline"}) {
    std::snprintf(path, sizeof path, "/proc/%d/%s", parent, name);
    tell("open-of-the-parent", ::open(path, O_RDONLY) >= 0);
  }
  tell("open", ::open("/etc/passwd", O_RDONLY) >= 0);
  tell("open-to-write", ::open("/tmp/varimesh-captured", O_WRONLY | O_CREAT, 0600) >= 0);
  for (int file = 0; file < 10; ++file) {
    std::snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    tell("open-again-to-write", ::open(path, O_RDWR) >= 0);
  }
  // If a file that can be changed was opened, something of it is.
  for (int file = 0; file < 10; ++file) {
    std::snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    const int again = ::open(path, O_RDWR);
    struct stat status {};
    const bool is_file = again >= 0 && ::fstat(again, &status) == 0 && S_ISREG(status.st_mode);
    tell("write-to-what-is-open", is_file && ::pwrite(again, "", 1, 0) == 1);
    constexpr int kBoth = PROT_READ | PROT_WRITE;
    tell("change-what-is-open", is_file && ::mmap(nullptr, 1, kBoth, MAP_SHARED, again, 0) != MAP_FAILED);
  }
  tell("open-of-a-library", ::open("/usr/lib/os-release", O_RDONLY) >= 0);
  tell("openat2",
       ::syscall(SYS_openat2, AT_FDCWD, "/etc/passwd", "\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", 24) >= 0);
  struct stat status {};
  tell("stat", ::stat("/etc/passwd", &status) == 0);
  tell("fstatat-with-a-path", ::fstatat(AT_FDCWD, "/etc/passwd", &status, AT_EMPTY_PATH) == 0);
  tell("access", ::access("/etc/passwd", F_OK) == 0);
  tell("readlink", ::readlink("/proc/self/exe", path, sizeof path) >= 0);
  tell("unlink", ::unlink("/tmp/varimesh-captured") == 0);
  tell("mkdir", ::mkdir("/tmp/varimesh-captured", 0700) == 0);
  tell("chdir", ::chdir("/") == 0);
  tell("io_uring", ::syscall(SYS_io_uring_setup, 1, path) >= 0);
}

void try_processes() {
  tell("ptrace", ::ptrace(PTRACE_ATTACH, parent, nullptr, nullptr) == 0);
  char byte = 0;
  iovec here{&byte, 1}, there{report, 1};
  tell("process_vm_readv", ::process_vm_readv(parent, &here, 1, &there, 1, 0) >= 0);
  tell("process_vm_writev", ::process_vm_writev(parent, &here, 1, &there, 1, 0) >= 0);
  tell("kill", ::kill(parent, 0) == 0);
  tell("tgkill", ::syscall(SYS_tgkill, parent, parent, 0) == 0);
  tell("pidfd_open", ::syscall(SYS_pidfd_open, parent, 0) >= 0);
  rlimit limits{};
  tell("prlimit-of-the-parent", ::prlimit(parent, RLIMIT_CORE, &limits, &limits) == 0);
  limits = {RLIM_INFINITY, RLIM_INFINITY};
  tell("setrlimit", ::setrlimit(RLIMIT_AS, &limits) == 0);
  const long child = ::syscall(SYS_clone, SIGCHLD, nullptr, nullptr, nullptr, nullptr);
  if (child == 0) ::_exit(0);
  tell("fork", child > 0);
  tell("vfork", ::syscall(SYS_clone, CLONE_VFORK | SIGCHLD, nullptr, nullptr, nullptr, nullptr) > 0);
  char* const words[] = {nullptr};
  tell("execve", ::execve("/nowhere", words, words) == 0 || errno == ENOENT);
  tell("namespace", ::unshare(CLONE_NEWUSER) == 0);
  tell("prctl", ::syscall(SYS_prctl, PR_SET_DUMPABLE, 1, 0, 0, 0) == 0);
}

void try_network_and_memory() {
  tell("socket", ::socket(AF_INET, SOCK_STREAM, 0) >= 0);
  tell("unix-socket", ::socket(AF_UNIX, SOCK_STREAM, 0) >= 0);
  int ends[2];
  tell("socketpair", ::socketpair(AF_UNIX, SOCK_STREAM, 0, ends) == 0);
  tell("pipe", ::pipe(ends) == 0);
  tell("pipe2", ::pipe2(ends, 0) == 0);
  constexpr unsigned long kSignalOwner = 0x8901;  // FIOSETOWN
  tell("signals-of-a-socket", ::ioctl(3, kSignalOwner, &parent) == 0);
  tell("owner-of-a-socket", ::fcntl(3, F_SETOWN, parent) == 0);
  tell("memfd", ::syscall(SYS_memfd_create, "captured", 0) >= 0);
  tell("shared-memory", ::syscall(SYS_shmget, 0, 4096, 0600 | 01000) >= 0);
  constexpr std::size_t kMuch = std::size_t{1} << 46;
  tell("memory", ::mmap(nullptr, kMuch, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0) != MAP_FAILED);
  constexpr int kAll = PROT_READ | PROT_WRITE | PROT_EXEC;
  tell("code", ::mmap(nullptr, 4096, kAll, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) != MAP_FAILED);
  tell("code-in-data", ::mprotect(report, 4096, kAll) == 0);
}

void attack() {
  ::signal(SIGXFSZ, SIG_IGN);  // a write beyond the limit of sizes fails, and does not end the process
  try_files();
  try_processes();
  try_network_and_memory();
  const char* const threads = std::getenv("CAPTURED_THREADS");
  if (threads == nullptr) return tell("end", false);
  // What it has reached is read from outside.
  const int started = threads_started(std::atoi(threads));
  tell("threads", started == std::atoi(threads));
  rlimit limits{};
  if (started == 0) tell("limit-of-processes", ::getrlimit(RLIMIT_NPROC, &limits) != 0 || limits.rlim_max != 0);
  tell("end", false);
  if (std::getenv("CAPTURED_STAYS") != nullptr)
    for (;;) ::pause();
}

__attribute__((constructor)) void map_report() {
  const char* const path = std::getenv("CAPTURED_REPORT");
  const int file = path == nullptr ? -1 : ::open(path, O_RDWR | O_CREAT, 0600);
  parent = ::getppid();
  if (file < 0 || ::ftruncate(file, kReportBytes) != 0) return;
  void* const mapped = ::mmap(nullptr, kReportBytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  ::close(file);
  if (mapped != MAP_FAILED) report = static_cast<char*>(mapped);
}

}  // namespace

/// The sandbox's last step goes through one of these.
extern "C" long syscall(long number, ...) noexcept {
  using Call = long(long, long, long, long, long, long, long);
  static Call* const real = reinterpret_cast<Call*>(::dlsym(RTLD_NEXT, "syscall"));
  va_list rest;
  va_start(rest, number);
  long arguments[6];
  for (long& argument : arguments) argument = va_arg(rest, long);
  va_end(rest);
  const long result = real(number, arguments[0], arguments[1], arguments[2], arguments[3], arguments[4], arguments[5]);
  const bool is_last = number == SYS_seccomp && arguments[0] == SECCOMP_SET_MODE_FILTER;
  if (is_last && result == 0 && report != nullptr && report[0] == '\0') attack();
  return result;
}

extern "C" int prctl(int what, ...) {
  va_list rest;
  va_start(rest, what);
  unsigned long arguments[4];
  for (unsigned long& argument : arguments) argument = va_arg(rest, unsigned long);
  va_end(rest);
  const long result = syscall(SYS_prctl, what, arguments[0], arguments[1], arguments[2], arguments[3]);
  if (what == PR_SET_SECCOMP && result == 0 && report != nullptr && report[0] == '\0') attack();
  return static_cast<int>(result);
}
