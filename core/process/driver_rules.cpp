#include "core/process/driver_rules.h"

#include <fcntl.h>
#include <sys/syscall.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <system_error>

#include "core/process/call_filter.h"
#include "core/process/landlock.h"

namespace varimesh {
namespace {

namespace fs = std::filesystem;

/// The files of the cards. Those for profilers and screens (nvidia-uvm-tools, nvidia-modeset) are none of them.
std::vector<std::string> cards() {
  std::vector<std::string> found{"/dev/nvidiactl", "/dev/nvidia-uvm", "/dev/nvidia-caps"};
  std::error_code none;
  for (const fs::directory_entry& file : fs::directory_iterator("/dev", none)) {
    const std::string name = file.path().filename().string();
    if (name.starts_with("nvidia") && name.find_first_not_of("0123456789", 6) == std::string::npos)
      found.push_back(file.path().string());
  }
  return found;
}

/// Paths with colons between them.
void add_paths(const char* paths, std::vector<std::string>& to) {
  std::istringstream all(paths == nullptr ? "" : paths);
  for (std::string path; std::getline(all, path, ':');)
    if (!path.empty()) to.push_back(path);
}

}  // namespace

bool open_only_files_of_the_driver() {
  OpenableFiles files{
      {"/usr", "/lib", "/lib64", "/etc/ld.so.cache", "/run/opengl-driver", "/sys", "/proc/self", "/proc/driver",
       "/proc/devices", "/proc/cpuinfo", "/proc/meminfo", "/proc/modules", "/proc/sys/vm", "/proc/version"},
      cards()};
  add_paths(std::getenv("LD_LIBRARY_PATH"), files.to_read);
  return open_only(files);
}

void allow_calls_of_the_driver(CallFilter& filter) {
  constexpr std::uint32_t kAll = ~std::uint32_t{0};
  for (const long call : {
#ifdef SYS_open
           SYS_open, SYS_stat, SYS_lstat, SYS_access, SYS_readlink,
#endif
           SYS_openat, SYS_newfstatat, SYS_statx, SYS_faccessat, SYS_readlinkat, SYS_getdents64, SYS_pipe2,
           SYS_eventfd2, SYS_getuid, SYS_geteuid, SYS_getgid, SYS_getegid, SYS_getrusage, SYS_get_mempolicy})
    filter.allow(call);
  // No command that makes a descriptor signal another process (F_SETOWN).
  filter.allow_any(SYS_fcntl, 1, {{kAll, F_GETFD}, {kAll, F_SETFD}, {kAll, F_GETFL}, {kAll, F_DUPFD_CLOEXEC}});
  // Commands of the driver's kernel module have the letter F (nv-ioctl-numbers.h of NVIDIA's open-gpu-kernel-modules).
  // Those of its managed memory are numbers below 256, and two more (uvm_linux_ioctl.h).
  constexpr std::uint32_t kLetter = 0xff00, kAllButNumber = 0xffffff00;
  filter.allow_any(SYS_ioctl, 1, {{kLetter, 'F' << 8}, {kAllButNumber, 0}, {kAll, 0x30000001}, {kAll, 0x30000002}});
}

}  // namespace varimesh
