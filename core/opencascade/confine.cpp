// System calls that OpenCASCADE has no use for are refused.
#include "core/opencascade/confine.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <cstdint>

#include "core/process/call_filter.h"

namespace varimesh::cad {
namespace {

constexpr long kRefused[] = {
    // Programs and other processes.
    SYS_execve,
    SYS_execveat,
    SYS_ptrace,
    SYS_process_vm_readv,
    SYS_process_vm_writev,
    SYS_kill,
    SYS_tkill,
    SYS_pidfd_open,
    SYS_pidfd_send_signal,
    SYS_pidfd_getfd,
    SYS_setpgid,
    SYS_prlimit64,
    // Networks.
    SYS_socket,
    SYS_socketpair,
    SYS_connect,
    SYS_bind,
    SYS_listen,
    SYS_accept,
    SYS_accept4,
    SYS_sendto,
    SYS_sendmsg,
    SYS_sendmmsg,
    // Names of files.
    SYS_openat2,
    SYS_unlinkat,
    SYS_renameat2,
    SYS_linkat,
    SYS_symlinkat,
    SYS_mkdirat,
    SYS_mknodat,
    SYS_fchmodat,
    SYS_fchownat,
    SYS_truncate,
    SYS_utimensat,
    SYS_setxattr,
    SYS_lsetxattr,
    SYS_mount,
    SYS_umount2,
    SYS_chroot,
    // The kernel.
    SYS_bpf,
    SYS_io_uring_setup,
    SYS_keyctl,
    SYS_add_key,
    SYS_request_key,
    SYS_perf_event_open,
    SYS_userfaultfd,
    SYS_unshare,
    SYS_setns,
#if defined(__x86_64__)
    SYS_creat,
    SYS_unlink,
    SYS_rename,
    SYS_renameat,
    SYS_link,
    SYS_symlink,
    SYS_mkdir,
    SYS_rmdir,
    SYS_mknod,
    SYS_chmod,
    SYS_chown,
    SYS_lchown,
    SYS_fork,
    SYS_vfork,
    SYS_utime,
    SYS_utimes,
#endif
};

}  // namespace

bool confine_this_process() {
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  CallFilter filter(CallFilter::Others::Allowed);
  for (const long call : kRefused) filter.refuse(call);
  constexpr std::uint32_t kWrites = O_WRONLY | O_RDWR | O_CREAT | O_TRUNC;
  filter.allow_if(SYS_openat, 2, kWrites, 0);
#if defined(__x86_64__)
  filter.allow_if(SYS_open, 1, kWrites, 0);
#endif
  filter.allow_threads();
  return filter.install();
}

}  // namespace varimesh::cad
