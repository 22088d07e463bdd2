// A filter for the system calls of this process: a program of the kernel's old packet filter (man 2 seccomp). It looks
// at the number of a call and at its arguments, not at what they point to.
#pragma once

#include <linux/filter.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <vector>

namespace varimesh {

/// Rules for system calls. The first rule for a call decides about it. Calls without a rule fail with EPERM.
class CallFilter {
 public:
  CallFilter();

  void allow(long call);
  /// The thread that makes the call gets SIGSYS, whose handler gives the call its result.
  void trap(long call);
  /// Of the bits of `mask`, the lower half of an argument has exactly these.
  struct Bits {
    std::uint32_t mask, bits;
  };
  /// Allows the call if the argument is like this. Otherwise it fails with EPERM.
  void allow_if(long call, int argument, std::uint32_t mask, std::uint32_t bits) {
    allow_any(call, argument, {{mask, bits}});
  }
  /// The same if the argument is like one of these.
  void allow_any(long call, int argument, std::initializer_list<Bits> those);
  /// Allows the call if the argument is a null pointer. Otherwise it fails with EPERM.
  void allow_null(long call, int argument);
  /// Threads are allowed, but no processes, and no threads that see another machine than this one.
  void allow_threads();

  /// From now on the rules hold for this thread and those that it starts. The process must have given up new rights
  /// (PR_SET_NO_NEW_PRIVS). Returns false, with errno, if the system has no such filters. Call it once.
  /// @param all_threads  the rules hold for the threads that the process has already, too
  bool install(bool all_threads = false);

 private:
  void load(std::size_t at);
  void add(int code, std::uint32_t value, std::uint8_t then = 0, std::uint8_t otherwise = 0);
  /// The next `instructions` instructions are for this call only.
  void only_for(long call, std::uint8_t instructions);
  void answer_allowed();
  void answer_refused(int error);

  std::vector<sock_filter> code_;
};

}  // namespace varimesh
