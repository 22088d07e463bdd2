// The filter is a program of the kernel's old packet filter (man 2 seccomp). It looks at the number of a system call
// and at the lower halves of its arguments.
#include "server/isolation/sandbox.h"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <vector>

namespace varimesh::server {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t kArchitecture = 0;
#endif

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

/// The filter's instructions.
class Program {
 public:
  Program() {
    load(offsetof(seccomp_data, arch));
    add(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0);
    add(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS);
    load(offsetof(seccomp_data, nr));
  }
  void allow(long call) {
    add(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 1);
    add(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
  }
  void refuse(long call, int error) {
    add(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 1);
    add(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | static_cast<std::uint32_t>(error));
  }
  /// Allows the call if the argument has exactly these of the bits of `mask`.
  void allow_if(long call, int argument, std::uint32_t mask, std::uint32_t bits) {
    add(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 5);
    load(offsetof(seccomp_data, args) + sizeof(std::uint64_t) * static_cast<std::size_t>(argument));
    add(BPF_ALU | BPF_AND | BPF_K, mask);
    add(BPF_JMP | BPF_JEQ | BPF_K, bits, 0, 1);
    add(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
    add(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM);
  }
  /// Allows the call if the argument is a null pointer.
  void allow_null(long call, int argument) {
    const std::size_t at = offsetof(seccomp_data, args) + sizeof(std::uint64_t) * static_cast<std::size_t>(argument);
    add(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 6);
    load(at);
    add(BPF_JMP | BPF_JEQ | BPF_K, 0, 0, 3);
    load(at + sizeof(std::uint32_t));
    add(BPF_JMP | BPF_JEQ | BPF_K, 0, 0, 1);
    add(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
    add(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM);
  }
  bool install() {
    add(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM);
    const sock_fprog program{static_cast<unsigned short>(code_.size()), code_.data()};
    return prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
  }

 private:
  void load(std::size_t at) { add(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(at)); }
  void add(int code, std::uint32_t value, std::uint8_t then = 0, std::uint8_t otherwise = 0) {
    code_.push_back({static_cast<std::uint16_t>(code), then, otherwise, value});
  }

  std::vector<sock_filter> code_;
};

void limit(int what, rlim_t most, rlim_t further = 0) {
  const rlimit limits{most, most + further};
  setrlimit(static_cast<__rlimit_resource>(what), &limits);
}

}  // namespace

bool filter_system_calls() {
  if (kArchitecture == 0) {
    errno = ENOSYS;
    return false;
  }
  Program program;
  for (const long call : kAllowed) program.allow(call);
  // Threads, but no processes. The newer call hides its flags from the filter; without it the library takes the older.
  program.refuse(SYS_clone3, ENOSYS);
  program.allow_if(SYS_clone, 0, CLONE_THREAD | CLONE_VM, CLONE_THREAD | CLONE_VM);
  program.allow_if(SYS_mmap, 2, PROT_EXEC, 0);
  program.allow_if(SYS_mprotect, 2, PROT_EXEC, 0);
  // Sizes of what is open, not of what has a name. Limits may be read, not changed. Signals to itself only.
  program.allow_if(SYS_newfstatat, 3, AT_EMPTY_PATH, AT_EMPTY_PATH);
  program.allow_null(SYS_prlimit64, 2);
  program.allow_if(SYS_tgkill, 0, ~std::uint32_t{0}, static_cast<std::uint32_t>(getpid()));
  return program.install();
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
