// Following a job to its end. Ctrl-C cancels the job or stops following it.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>

#include "client/cli/common_flags.h"
#include "client/client.h"

namespace varimesh::client {

/// What an interrupt does to the job that is being followed.
enum class OnInterrupt { CancelJob, LeaveJob };

/// Shows the progress of a job after event number `after` until the job ends, and returns the job as it ended. The
/// error is the exit status; its message has been printed.
tl::expected<v1::Job, int> follow(Client* client, const std::string& name, std::int64_t after, const CommonFlags& flags,
                                  OnInterrupt on_interrupt);

}  // namespace varimesh::client
