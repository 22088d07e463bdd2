#include "core/process/sandbox.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "core/process/call_filter.h"
#include "core/process/driver_rules.h"

namespace varimesh {
namespace {

/// Calls that are allowed whatever their arguments are. None of them takes a path, an address or another process, and
/// none gives memory that RLIMIT_AS does not count.
constexpr long kAllowed[] = {
    // What is open already: sockets, a mesh, files without a name.
    SYS_read,
    SYS_write,
    SYS_readv,
    SYS_writev,
    SYS_pread64,
    SYS_pwrite64,
    SYS_lseek,
    SYS_dup,
    SYS_close,
    SYS_recvmsg,
    SYS_sendmsg,
    SYS_recvfrom,
    SYS_sendto,
    SYS_ppoll,
    SYS_fstat,
    SYS_ftruncate,
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

/// What answer_here() opens.
const char* opened_path = nullptr;
int opened_file = -1;

void limit(int what, rlim_t most, rlim_t further = 0) {
  const rlimit limits{most, most + further};
  setrlimit(static_cast<__rlimit_resource>(what), &limits);
}

/// A call that was trapped: its arguments, and the place of its result.
struct Trapped {
#if defined(__x86_64__)
  explicit Trapped(ucontext_t& at)
      : arguments{at.uc_mcontext.gregs[REG_RDI], at.uc_mcontext.gregs[REG_RSI], at.uc_mcontext.gregs[REG_RDX],
                  at.uc_mcontext.gregs[REG_R10]},
        result(at.uc_mcontext.gregs[REG_RAX]) {}
  const long long arguments[4];
  greg_t& result;
#elif defined(__aarch64__)
  explicit Trapped(ucontext_t& at)
      : arguments{static_cast<long long>(at.uc_mcontext.regs[0]), static_cast<long long>(at.uc_mcontext.regs[1]),
                  static_cast<long long>(at.uc_mcontext.regs[2]), static_cast<long long>(at.uc_mcontext.regs[3])},
        result(at.uc_mcontext.regs[0]) {}
  const long long arguments[4];
  unsigned long long& result;
#else
  explicit Trapped(ucontext_t&) {}
  const long long arguments[4] = {};
  long long result = 0;
#endif
};

long copy_of_file(const char* path, long long flags) {
  if (opened_path == nullptr || std::strcmp(path, opened_path) != 0 || (flags & O_ACCMODE) != O_RDONLY) return -EPERM;
  const int copy = ::dup(opened_file);
  if (copy < 0) return -errno;
  ::lseek(copy, 0, SEEK_SET);
  return copy;
}

/// Answers a call with a path in the process itself, which can do no more than the filter lets it: the filter cannot
/// look at paths, and the C library asks for the size of an open file by an empty one.
void answer_here(int, siginfo_t* info, void* context) {
  const int kept = errno;
  Trapped call(*static_cast<ucontext_t*>(context));
  long result = -EPERM;
  const auto text = [&](int argument) { return reinterpret_cast<const char*>(call.arguments[argument]); };
#ifdef SYS_open
  if (info->si_syscall == SYS_open) result = copy_of_file(text(0), call.arguments[1]);
#endif
  if (info->si_syscall == SYS_openat) result = copy_of_file(text(1), call.arguments[2]);
  if (info->si_syscall == SYS_newfstatat && (call.arguments[3] & AT_EMPTY_PATH) != 0 && *text(1) == '\0')
    result = ::syscall(SYS_fstat, call.arguments[0], call.arguments[2]) == 0 ? 0 : -errno;
  call.result = result;
  errno = kept;
}

bool install_filter(const Confinement& keeps) {
  struct sigaction action {};
  action.sa_sigaction = answer_here;
  action.sa_flags = SA_SIGINFO | SA_NODEFER | SA_ONSTACK;
  if (::sigaction(SIGSYS, &action, nullptr) != 0) return false;
  CallFilter filter;
  if (keeps.has_device) allow_calls_of_the_driver(filter);
  for (const long call : kAllowed) filter.allow(call);
  for (const long call : {SYS_newfstatat, SYS_openat}) filter.trap(call);
#ifdef SYS_open
  filter.trap(SYS_open);
#endif
  if (keeps.threads) filter.allow_threads();
  filter.allow_if(SYS_mmap, 2, PROT_EXEC, 0);
  filter.allow_if(SYS_mprotect, 2, PROT_EXEC, 0);
  // Limits may be read, not changed. Signals to itself only.
  filter.allow_null(SYS_prlimit64, 2);
  filter.allow_if(SYS_tgkill, 0, ~std::uint32_t{0}, static_cast<std::uint32_t>(getpid()));
  return filter.install(keeps.has_threads);
}

}  // namespace

void begin_confinement() {
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0);
  if (std::FILE* const score = std::fopen("/proc/self/oom_score_adj", "we")) {
    std::fputs("500", score);
    std::fclose(score);
  }
  limit(RLIMIT_CORE, 0);
}

bool confine_this_process(const Confinement& keeps) {
  constexpr rlim_t kSecondsToEnd = 5;
  if (keeps.processor_seconds > 0) limit(RLIMIT_CPU, static_cast<rlim_t>(keeps.processor_seconds), kSecondsToEnd);
  const auto kind = keeps.has_device ? RLIMIT_DATA : RLIMIT_AS;
  if (rlimit now{}; keeps.memory > 0 && getrlimit(kind, &now) == 0) {
    const rlim_t most = std::min(static_cast<rlim_t>(keeps.memory), now.rlim_max);
    limit(kind, most, keeps.memory_can_be_raised ? now.rlim_max - most : 0);
  }
  limit(RLIMIT_FSIZE, static_cast<rlim_t>(keeps.file_bytes));
  // The filter refuses both anyway. A limit above 0 would count what other processes of this user have, too.
  if (!keeps.threads) limit(RLIMIT_NPROC, 0);
  // The next descriptor would be the lowest free number, which must be below the limit.
  if (const int next = ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0); next >= 0) {
    ::close(next);
    const int more = keeps.more_descriptors + (keeps.has_device ? kDriverDescriptors : 0);
    limit(RLIMIT_NOFILE, static_cast<rlim_t>(next + more));
  }
  opened_path = keeps.path;
  opened_file = keeps.file;
  return install_filter(keeps);
}

}  // namespace varimesh
