#include "client/jobs/remote_job.h"

#include <utility>

#include "client/cli/default_server.h"

namespace varimesh::client {

CLI::App& add_remote_command(CLI::App& app, const char* name, const char* purpose, CommonFlags* flags) {
  CLI::App& command = *app.add_subcommand(name, purpose);
  add_server_flag(command, flags)
      ->description(
          "Address of a varimeshd: HOST:PORT or unix:PATH; default: the environment variable VARIMESH_SERVER, or the "
          "socket of a varimeshd of yours that was started without an address");
  add_json_flag(command, flags);
  command.final_callback([flags] {
    if (!flags->server.empty()) return;
    auto found = default_server();
    if (!found) throw CLI::ValidationError(found.error().sentence);
    flags->server = std::move(*found);
  });
  return command;
}

void add_job_argument(CLI::App& command, std::string* job) {
  command.add_option("job", *job, "The name of the job")->required()->type_name("JOB")->check(is_text());
}

void add_label_flag(CLI::App& command, std::vector<std::string>* labels, const char* help) {
  command.add_option("--label", *labels, help)->type_name("KEY=VALUE")->check(is_text())->allow_extra_args(false);
}

std::string full_name(const std::string& job) { return job.rfind("jobs/", 0) == 0 ? job : "jobs/" + job; }

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
