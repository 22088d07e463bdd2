// The jobs that a command for several jobs is about: those that are named, or those with certain labels.
#pragma once

#include <string>
#include <vector>

#include "client/cli/parser.h"
#include "client/client.h"

namespace varimesh::client {

/// What the user chose. Either `names`, or all jobs with `labels`.
struct Selection {
  std::vector<std::string> names;
  bool all = false;
  std::vector<std::string> labels;  ///< KEY=VALUE.
};

/// Adds the positional arguments JOB and the flags --all and --label.
void add_selection(Command command, Selection* selection);

/// The chosen jobs as they are now: in the order of their names on the command line, each once, or newest first.
/// Refused with BAD_OPTION if nothing was chosen, if names and labels are mixed, or if no job has the labels; with
/// JOB_NOT_FOUND if a job that is named does not exist.
Outcome<std::vector<v1::Job>> chosen(Client* client, const Selection& selection);

}  // namespace varimesh::client
