// Following a job to its end, and what the command does then. optimise, watch and result share it.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "client/client.h"
#include "client/command/command.h"
#include "client/command/outputs.h"

namespace varimesh::client {

/// Watches a job to its end and shows its progress. Ctrl-C cancels the job where `owned`, and only stops watching where
/// not. The error is the exit status.
tl::expected<v1::Job, int> follow(Client* client, const std::string& name, std::int64_t after, const CommonFlags& flags,
                                  bool owned);

/// What to do with a job that has ended.
struct Delivery {
  std::string input;  ///< The mesh's file, for what there is to say about it; empty: not known.
  std::vector<Output> outputs;
  std::string history;          ///< Where it goes; empty: nowhere.
  std::string report;           ///< Likewise.
  bool also_cancelled = false;  ///< Of a job that was cancelled while it ran, the mesh as it was then will do.
};

/// Fetches the outputs, the history and the report of a job that has ended, prints the document or the summary, and
/// returns the exit status. Where it did not succeed: says why. A summary makes way for a mesh that goes to standard
/// output.
int deliver(Client* client, const v1::Job& job, const Delivery& delivery, const CommonFlags& flags);

}  // namespace varimesh::client
