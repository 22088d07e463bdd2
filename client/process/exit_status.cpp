#include "client/process/exit_status.h"

#include <array>
#include <iostream>

#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

constexpr std::array kExitStatuses{
    ExitStatusMeaning{kDone, "success, and every element is certified valid (quality checks that only with --certify)"},
    ExitStatusMeaning{kJobFailed, "the job failed, or someone else cancelled it"},
    ExitStatusMeaning{kUsage,
                      "wrong usage: an unknown or unsuitable option, a job that does not exist, or a token that "
                      "does not allow it"},
    ExitStatusMeaning{kInputRefused, "the input was refused, or the output cannot be written"},
    ExitStatusMeaning{kInvalidLeft, "success, but some elements are not certified valid"},
    ExitStatusMeaning{kServer, "the server failed or cannot be reached"},
    ExitStatusMeaning{
        kPartLeft,
        "success, and every element is certified valid, but a part of what was asked for is missing: some "
        "boundary elements stay straight (curve, mesh), or the run ended before it made layers"},
    ExitStatusMeaning{kInterrupted, "interrupted; a run without --server has written its best mesh so far"},
};

}  // namespace

std::span<const ExitStatusMeaning> exit_statuses() { return kExitStatuses; }

int status_of_reason(const std::string& reason) {
  if (reason == "BAD_INPUT" || reason == "OUTPUT" || reason == "MESH_TOO_LARGE") return kInputRefused;
  if (reason == "BAD_OPTION" || reason == "BAD_REQUEST" || reason == "JOB_NOT_FOUND" || reason == "JOB_NOT_ENDED" ||
      reason == "REQUEST_ID_USED" || reason == "TOKEN_MISSING" || reason == "TOKEN_UNKNOWN" ||
      reason == "RIGHT_MISSING")
    return kUsage;
  if (reason == "STORE_FULL" || reason == "QUEUE_FULL" || reason == "PEER_LIMIT" || reason == "OWNER_FULL" ||
      reason == "STOPPING" || reason == "STORE_UNAVAILABLE")
    return kServer;
  return kJobFailed;
}

int print_error(const Error& error) {
  std::cerr << "varimesh: " << as_plain_text(error.sentence) << std::endl;
  switch (error.kind) {
    case Error::Kind::BadInput:
    case Error::Kind::Output:
      return kInputRefused;
    case Error::Kind::BadOption:
      return kUsage;
    case Error::Kind::Internal:
      break;
  }
  return kJobFailed;
}

int print_error(const Failure& failure) {
  std::cerr << "varimesh: " << as_plain_text(failure.sentence) << std::endl;
  switch (failure.kind) {
    case Failure::Kind::Transport:
      return kServer;
    case Failure::Kind::File:
      return kInputRefused;
    case Failure::Kind::Interrupted:
      return kInterrupted;
    case Failure::Kind::Refused:
      break;
  }
  return status_of_reason(failure.reason);
}

int print_uncertified(std::int64_t invalid, std::int64_t undecided) {
  if (invalid > 0)
    std::cerr << "varimesh: " << invalid << (invalid == 1 ? " element is" : " elements are") << " invalid" << std::endl;
  if (undecided > 0)
    std::cerr << "varimesh: " << undecided << (undecided == 1 ? " element is" : " elements are")
              << " proved neither valid nor invalid" << std::endl;
  return invalid + undecided == 0 ? kDone : kInvalidLeft;
}

}  // namespace varimesh::client
