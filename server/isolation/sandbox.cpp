#include "server/isolation/sandbox.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>

#include "core/process/call_filter.h"

namespace varimesh::server {
namespace {

/// Calls that are allowed whatever their arguments are. None of them takes a path, an address or another process.
constexpr long kAllowed[] = {
    // What is open already: the socket to the server, the mesh, files without a name.
    SYS_read,
    SYS_write,
    SYS_readv,
    SYS_writev,
    SYS_pread64,
    SYS_pwrite64,
    SYS_lseek,
    SYS_close,
    SYS_recvmsg,
    SYS_sendmsg,
    SYS_recvfrom,
    SYS_sendto,
    SYS_ppoll,
    SYS_fstat,
    SYS_ftruncate,
    SYS_memfd_create,
    SYS_restart_syscall,
#ifdef SYS_poll
    SYS_poll,
#endif
    // Memory.
    SYS_munmap,
    SYS_mremap,
    SYS_madvise,
    SYS_brk,
    SYS_membarrier,
    // Threads.
    SYS_futex,
    SYS_set_robust_list,
    SYS_rseq,
    SYS_exit,
    SYS_exit_group,
    SYS_sched_yield,
    SYS_sched_getaffinity,
    SYS_gettid,
    SYS_getpid,
    SYS_getcpu,
    SYS_rt_sigprocmask,
    SYS_rt_sigaction,
    SYS_rt_sigreturn,
    SYS_sigaltstack,
    // Time, and what the machine is.
    SYS_clock_gettime,
    SYS_clock_getres,
    SYS_clock_nanosleep,
    SYS_nanosleep,
    SYS_gettimeofday,
    SYS_getrandom,
    SYS_sysinfo,
    SYS_uname,
};

void limit(int what, rlim_t most, rlim_t further = 0) {
  const rlimit limits{most, most + further};
  setrlimit(static_cast<__rlimit_resource>(what), &limits);
}

}  // namespace

bool filter_system_calls() {
  CallFilter filter(CallFilter::Others::Refused);
  for (const long call : kAllowed) filter.allow(call);
  filter.allow_threads();
  filter.allow_if(SYS_mmap, 2, PROT_EXEC, 0);
  filter.allow_if(SYS_mprotect, 2, PROT_EXEC, 0);
  // Sizes of what is open, not of what has a name. Limits may be read, not changed. Signals to itself only.
  filter.allow_if(SYS_newfstatat, 3, AT_EMPTY_PATH, AT_EMPTY_PATH);
  filter.allow_null(SYS_prlimit64, 2);
  filter.allow_if(SYS_tgkill, 0, ~std::uint32_t{0}, static_cast<std::uint32_t>(getpid()));
  return filter.install();
}

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
  // The next descriptor would be the lowest free number. An HDF5 file takes two: the file and the program's socket.
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
