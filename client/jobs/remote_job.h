// What the commands for the jobs of a server share.
#pragma once

#include <string>
#include <vector>

#include "client/cli/common_flags.h"
#include "client/client.h"
#include "core/base/error.h"

namespace varimesh::client {

/// Adds a subcommand that needs a server, with --server and --json.
Command add_remote_command(Command program, const char* name, const char* purpose, CommonFlags* flags);
/// Adds the positional argument JOB.
void add_job_argument(Command command, std::string* job);
/// Adds --label; `help` is its text.
void add_label_flag(Command command, std::vector<std::string>* labels, const char* help);

/// The full name of a job, which may be given without its "jobs/", and by the first letters that no other job's name
/// begins with. BAD_OPTION if several do. A name that nothing begins with is left for the server to refuse.
Outcome<std::string> full_name(Client* client, const std::string& job);
/// The job of that name. Errors: those of full_name(), and what the server refuses.
Outcome<v1::Job> job_named(Client* client, const std::string& job);
/// Turns KEY=VALUE into entries of `map`. Errors: BadOption.
Expected<void> parse_labels(const std::vector<std::string>& labels,
                            google::protobuf::Map<std::string, std::string>* map);

}  // namespace varimesh::client
