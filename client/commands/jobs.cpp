// varimesh jobs: lists the jobs of a server.
#include <fmt/format.h>

#include <iostream>

#include "client/cli/names.h"
#include "client/commands/commands.h"
#include "client/commands/remote_job.h"
#include "client/io/documents.h"
#include "client/jobs/connection.h"
#include "client/process/exit_status.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::vector<std::string> labels, states;
};

int list(const Arguments& arguments) {
  v1::ListJobsRequest filter;
  if (const auto labels = parse_labels(arguments.labels, filter.mutable_labels()); !labels)
    return print_error(labels.error());
  for (const std::string& name : arguments.states) {
    const auto* state = value_of(*v1::JobState_descriptor(), name);
    if (state == nullptr) return print_error(Error{Error::Kind::BadOption, "There is no state '" + name + "'."});
    filter.add_states(static_cast<v1::JobState>(state->number()));
  }
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto jobs = connection->client->list(filter);
  if (!jobs) return print_error(jobs.error());
  if (arguments.common.json) {
    Json documents = Json::array();
    for (const v1::Job& job : *jobs) documents.push_back(document(job));
    print({{"jobs", documents}});
    return kDone;
  }
  for (const v1::Job& job : *jobs)
    std::cout << fmt::format("{:<24}  {:<10}  {:>6} iterations\n", job.name(), spelled(job.state()),
                             job.has_metrics() ? job.metrics().iterations() : job.iteration().number());
  return kDone;
}

}  // namespace

Action add_jobs(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = add_remote_command(app, "jobs", "List the jobs of a server, newest first", &arguments->common);
  command.add_option("--state", arguments->states, "List only jobs in this state; may be repeated")
      ->type_name("STATE")
      ->allow_extra_args(false);
  add_label_flag(command, &arguments->labels, "List only jobs with this label; may be repeated");
  return [arguments] { return list(*arguments); };
}

}  // namespace varimesh::client
