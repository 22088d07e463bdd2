#include "core/process/sandbox.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>

#include "core/process/call_filter.h"

namespace varimesh {
namespace {

/// Calls that are allowed whatever their arguments are. None of them takes a path, an address or another process.
constexpr long kAllowed[] = {
    // What is open already: sockets, a mesh, files without a name.
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

}  // namespace

bool use_only_open_files() {
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

}  // namespace varimesh
