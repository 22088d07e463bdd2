// What a command does with a job that has ended: it fetches the outputs, prints the result and chooses the exit status.
#pragma once

#include <string>
#include <vector>

#include "client/cli/common_flags.h"
#include "client/client.h"
#include "client/io/outputs.h"

namespace varimesh::client {

/// What to do with a job that has ended.
struct Delivery {
  std::string input;     ///< The path of the input, for messages and the report; empty: not known.
  std::string geometry;  ///< The path of the job's CAD file, for messages; empty: not known.
  std::vector<Output> outputs;
  std::string history;             ///< The path of the history; empty: do not write one.
  std::string report;              ///< The path of the report page; empty: do not write one.
  bool accepts_cancelled = false;  ///< A job that was cancelled while it ran has a mesh too; deliver that.
};

/// Fetches the outputs, the history and the report, prints the JSON document or the summary, and returns the exit
/// status. If the job did not succeed, it prints why. The summary goes to standard error if an output, the history or
/// the report is standard output.
int deliver(Client* client, const v1::Job& job, const Delivery& delivery, const CommonFlags& flags);

/// If a job has ended without the layers that it was to make, says so, and returns the exit status for that unless the
/// job has a worse one; otherwise `status`.
int status_with_layers(const v1::Job& job, int status);

}  // namespace varimesh::client
