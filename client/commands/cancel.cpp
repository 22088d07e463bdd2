// varimesh cancel: asks a job to end.
#include <iostream>

#include "client/cli/names.h"
#include "client/commands/commands.h"
#include "client/io/documents.h"
#include "client/jobs/connection.h"
#include "client/jobs/remote_job.h"
#include "client/process/exit_status.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::string job;
};

int cancel(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto name = full_name(connection->client.get(), arguments.job);
  if (!name) return print_error(name.error());
  const auto job = connection->client->cancel(*name);
  if (!job) return print_error(job.error());
  if (arguments.common.json)
    print(document(*job));
  else
    std::cout << job->name() << ' ' << spelled(job->state()) << '\n';
  return kDone;
}

}  // namespace

Action add_cancel(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command =
      add_remote_command(program, "cancel", "End a job at once and keep its best mesh", &arguments->common);
  add_job_argument(command, &arguments->job);
  return [arguments] { return cancel(*arguments); };
}

}  // namespace varimesh::client
