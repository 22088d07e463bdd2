// Work in a child that is in the sandbox. The child has one thread, as the program that forks it has.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <functional>

#include "core/process/sandbox.h"

namespace varimesh::testing {

/// Runs `work` in a child behind the filter. Returns its exit status: `work` returns it; 99 without a filter.
/// @param before  what the child does before it is confined; false: its exit status is 98
inline int behind_the_filter(
    const std::function<int()>& work, const Confinement& keeps = {},
    const std::function<bool()>& before = [] { return true; }) {
  const pid_t child = ::fork();
  if (child == 0) {
    begin_confinement();
    if (!before()) ::_exit(98);
    if (!confine_this_process(keeps)) ::_exit(99);
    ::_exit(work());
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

/// 0 if the call was refused with EPERM, or with `otherwise`.
template <class Result>
int refused(Result result, int otherwise = EPERM) {
  return result < 0 && (errno == EPERM || errno == otherwise) ? 0 : 1;
}

}  // namespace varimesh::testing
