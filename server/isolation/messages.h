// What the server and the process of a job say to each other, and the same as types of the service.
#pragma once

#include "core/base/error.h"
#include "server/engine/engine.h"
#include "server/isolation/worker.pb.h"

namespace varimesh::server {

/// The run, without what is about files and limits.
worker::Request message_of(const RunRequest& request);
/// The same run. Its input and its model are missing.
RunRequest request_of(const worker::Request& message);

/// Yes, no or an error, as an answer to the process.
worker::ToWorker answer_of(const Expected<bool>& outcome);
/// The same answer, as the process has it.
Expected<bool> outcome_of(const worker::Answer& answer);

/// What the process is to look at all the time.
/// @param threads  how many the run may use if the hooks do not say
/// @param full  the store takes no more of the output
worker::Steering steering_by(const RunHooks& hooks, int threads, bool full);

}  // namespace varimesh::server
