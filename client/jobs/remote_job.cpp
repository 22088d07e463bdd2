#include "client/jobs/remote_job.h"

#include <utility>

#include "client/cli/default_server.h"
#include "client/library/failures.h"

namespace varimesh::client {

Command add_remote_command(Command program, const char* name, const char* purpose, CommonFlags* flags) {
  Command command = program.add_command(name, purpose);
  add_server_flag(command, flags)
      .help(
          "Address of a varimeshd: HOST:PORT or unix:PATH; default: the environment variable VARIMESH_SERVER, or the "
          "socket of a varimeshd of yours that was started without an address");
  add_json_flag(command, flags);
  command.at_end([flags]() -> Expected<void> {
    if (!flags->server.empty()) return {};
    auto found = default_server();
    if (!found) return tl::unexpected(found.error());
    flags->server = std::move(*found);
    return {};
  });
  return command;
}

void add_job_argument(Command command, std::string* job) {
  command.add("job", job, "The name of the job, or its first letters").required().value("JOB").utf8();
}

void add_label_flag(Command command, std::vector<std::string>* labels, const char* help) {
  command.add("--label", labels, help).value("KEY=VALUE").utf8().one_value_each();
}

Outcome<std::string> full_name(Client* client, const std::string& job) {
  constexpr std::size_t kWhole = sizeof "jobs/0123456789abcdef" - 1;
  const std::string name = job.starts_with("jobs/") ? job : "jobs/" + job;
  if (name.size() >= kWhole) return name;
  const auto jobs = client->list({});
  if (!jobs) return tl::unexpected(jobs.error());
  std::vector<std::string> found;
  for (const v1::Job& one : *jobs) {
    if (one.name() == name) return name;
    if (one.name().starts_with(name)) found.push_back(one.name());
  }
  if (found.empty()) return name;
  if (found.size() > 1)
    return refusal("BAD_OPTION", std::to_string(found.size()) + " jobs have names that begin with '" + name +
                                     "', such as " + found[0] + " and " + found[1] + "; write more of the name.");
  return found[0];
}

Outcome<v1::Job> job_named(Client* client, const std::string& job) {
  const auto name = full_name(client, job);
  if (!name) return tl::unexpected(name.error());
  return client->get(*name);
}

Expected<void> parse_labels(const std::vector<std::string>& labels,
                            google::protobuf::Map<std::string, std::string>* map) {
  for (const std::string& label : labels) {
    const auto equals = label.find('=');
    if (equals == std::string::npos || equals == 0)
      return bad_option("The label '" + label + "' is not of the form KEY=VALUE.");
    (*map)[label.substr(0, equals)] = label.substr(equals + 1);
  }
  return {};
}

}  // namespace varimesh::client
