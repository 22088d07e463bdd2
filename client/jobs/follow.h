// Following a job to its end, and what Ctrl-C means meanwhile.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>

#include "client/cli/common_flags.h"
#include "client/client.h"

namespace varimesh::client {

/// What an interrupt does to the job that is being followed.
enum class OnInterrupt {
  EndJob,    ///< Cancels it; what it has so far is its result. For a job of this process, which would end too.
  Ask,       ///< Asks on a terminal whether to leave it running or to cancel it. Elsewhere it goes on running.
  LeaveJob,  ///< It goes on running.
};

/// Shows the progress of a job after event number `after` until the job ends, and returns the job as it ended. A job
/// that an interrupt cancelled may have a result. The error is the exit status; its message has been printed. If an
/// interrupt leaves the job running, the message names the commands that come back to it.
tl::expected<v1::Job, int> follow(Client* client, const std::string& name, std::int64_t after, const CommonFlags& flags,
                                  OnInterrupt on_interrupt);

}  // namespace varimesh::client
