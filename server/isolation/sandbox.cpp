#include "server/isolation/sandbox.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>

namespace varimesh::server {
namespace {

void limit(int what, rlim_t most, rlim_t further = 0) {
  const rlimit limits{most, most + further};
  setrlimit(static_cast<__rlimit_resource>(what), &limits);
}

}  // namespace

void limit_this_process(std::int64_t processor_seconds) {
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0);
  // If the machine runs out of memory, the system ends this process before the server.
  if (std::FILE* const score = std::fopen("/proc/self/oom_score_adj", "we")) {
    std::fputs("500", score);
    std::fclose(score);
  }
  limit(RLIMIT_CORE, 0);
  if (processor_seconds > 0)
    limit(RLIMIT_CPU, static_cast<rlim_t>(processor_seconds), 5);  // then SIGXCPU, which names it
  // The next descriptor would be the lowest free number. An HDF5 file takes one: the program's socket.
  constexpr int kMore = 16;
  if (const int next = ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0); next >= 0) {
    ::close(next);
    limit(RLIMIT_NOFILE, static_cast<rlim_t>(next + kMore));
  }
}

std::int64_t address_space() {
  long pages = 0;
  std::FILE* const file = std::fopen("/proc/self/statm", "re");
  if (file == nullptr) return 0;
  if (std::fscanf(file, "%ld", &pages) != 1) pages = 0;
  std::fclose(file);
  return static_cast<std::int64_t>(pages) * sysconf(_SC_PAGESIZE);
}

}  // namespace varimesh::server
