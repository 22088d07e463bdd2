// Exit statuses, and the errors that are printed before the command ends with one.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "client/client.h"
#include "core/base/error.h"
#include "core/command_line/facts.h"

namespace varimesh::client {

/// The same for every subcommand; exit_statuses() says what they mean.
enum ExitStatus {
  kDone = 0,
  kJobFailed = 1,
  kUsage = 2,
  kInputRefused = 3,
  kInvalidLeft = 4,
  kServer = 5,
  kPartLeft = 6,
  kInterrupted = 130,
};

/// In words, for the help and the manual.
std::span<const ExitStatusMeaning> exit_statuses();

/// Prints "varimesh: SENTENCE" on standard error and returns the exit status for the error.
int print_error(const Error& error);
int print_error(const Failure& failure);
/// The exit status for the reason of a job's error or of a refused call.
int status_of_reason(const std::string& reason);

/// Prints on standard error how many elements are not certified valid, and returns the exit status for that.
int print_uncertified(std::int64_t invalid, std::int64_t undecided);

}  // namespace varimesh::client
