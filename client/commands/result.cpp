// varimesh result: fetches the result of a job.
#include "client/commands/commands.h"
#include "client/io/outputs.h"
#include "client/jobs/connection.h"
#include "client/jobs/deliver.h"
#include "client/jobs/remote_job.h"
#include "client/process/exit_status.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::string job, format, history, report;
  std::vector<std::string> outputs;
};

int result(const Arguments& arguments) {
  const auto outputs = check_outputs(arguments.outputs, arguments.format);
  if (!outputs) return print_error(outputs.error());
  const auto distinct = check_distinct(*outputs, {arguments.history, arguments.report}, arguments.common.json);
  if (!distinct) return print_error(distinct.error());
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  Client* client = connection->client.get();
  const auto job = job_named(client, arguments.job);
  if (!job) return print_error(job.error());
  Delivery delivery;
  delivery.outputs = *outputs;
  delivery.history = arguments.history;
  delivery.report = arguments.report;
  delivery.accepts_cancelled = true;
  return deliver(client, *job, delivery, arguments.common);
}

}  // namespace

Action add_result(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command = add_remote_command(program, "result",
                                       "Fetch the result of a job that has succeeded, or was cancelled while it ran",
                                       &arguments->common);
  add_job_argument(command, &arguments->job);
  command.add("-o,--output", &arguments->outputs, "Write the result to this file; may be repeated")
      .value("OUT")
      .one_value_each()
      .or_standard_output();
  command.add("--format", &arguments->format, "One of the formats of the job; default: the format of the input")
      .value("NAME");
  add_history_flag(command, &arguments->history);
  add_report_flag(command, &arguments->report);
  add_compress_flag(command, &arguments->common);
  add_quiet_flag(command, &arguments->common);
  return [arguments] { return result(*arguments); };
}

}  // namespace varimesh::client
