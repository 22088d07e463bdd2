#include "core/process/call_filter.h"

#include <linux/audit.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstddef>

namespace varimesh {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t kArchitecture = 0;
#endif

std::size_t place_of(int argument) {
  return offsetof(seccomp_data, args) + sizeof(std::uint64_t) * static_cast<std::size_t>(argument);
}

}  // namespace

CallFilter::CallFilter() {
  load(offsetof(seccomp_data, arch));
  add(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0);
  add(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS);
  load(offsetof(seccomp_data, nr));
#if defined(__x86_64__)
  // The numbers of the x32 interface begin here; with them the others could be passed by.
  constexpr std::uint32_t kX32 = 0x40000000;
  add(BPF_JMP | BPF_JGE | BPF_K, kX32, 0, 1);
  answer_refused(ENOSYS);
#endif
}

void CallFilter::allow(long call) {
  only_for(call, 1);
  answer_allowed();
}

void CallFilter::trap(long call) {
  only_for(call, 1);
  add(BPF_RET | BPF_K, SECCOMP_RET_TRAP);
}

void CallFilter::allow_any(long call, int argument, std::initializer_list<Bits> those) {
  constexpr std::size_t kEach = 4;
  only_for(call, static_cast<std::uint8_t>(kEach * those.size() + 1));
  for (const auto& [mask, bits] : those) {
    load(place_of(argument));
    add(BPF_ALU | BPF_AND | BPF_K, mask);
    add(BPF_JMP | BPF_JEQ | BPF_K, bits, 0, 1);
    answer_allowed();
  }
  answer_refused(EPERM);
}

void CallFilter::allow_null(long call, int argument) {
  only_for(call, 6);
  load(place_of(argument));
  add(BPF_JMP | BPF_JEQ | BPF_K, 0, 0, 3);
  load(place_of(argument) + sizeof(std::uint32_t));
  add(BPF_JMP | BPF_JEQ | BPF_K, 0, 0, 1);
  answer_allowed();
  answer_refused(EPERM);
}

void CallFilter::allow_threads() {
  // The newer call hides its flags from the filter; without it the library takes the older.
  only_for(SYS_clone3, 1);
  answer_refused(ENOSYS);
  constexpr std::uint32_t kThread = CLONE_THREAD | CLONE_VM;
  constexpr std::uint32_t kOtherViews =
      CLONE_NEWNS | CLONE_NEWCGROUP | CLONE_NEWUTS | CLONE_NEWIPC | CLONE_NEWUSER | CLONE_NEWPID | CLONE_NEWNET;
  allow_if(SYS_clone, 0, kThread | kOtherViews, kThread);
}

bool CallFilter::install(bool all_threads) {
  if (kArchitecture == 0) {
    errno = ENOSYS;
    return false;
  }
  answer_refused(EPERM);
  const sock_fprog program{static_cast<unsigned short>(code_.size()), code_.data()};
  if (!all_threads) return prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
  return ::syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program) == 0;
}

void CallFilter::load(std::size_t at) { add(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(at)); }

void CallFilter::add(int code, std::uint32_t value, std::uint8_t then, std::uint8_t otherwise) {
  code_.push_back({static_cast<std::uint16_t>(code), then, otherwise, value});
}

void CallFilter::only_for(long call, std::uint8_t instructions) {
  add(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, instructions);
}

void CallFilter::answer_allowed() { add(BPF_RET | BPF_K, SECCOMP_RET_ALLOW); }

void CallFilter::answer_refused(int error) {
  add(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | static_cast<std::uint32_t>(error));
}

}  // namespace varimesh
