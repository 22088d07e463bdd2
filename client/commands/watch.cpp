// varimesh watch: follows a job to its end.
#include "client/commands/commands.h"
#include "client/jobs/connection.h"
#include "client/jobs/deliver.h"
#include "client/jobs/follow.h"
#include "client/jobs/remote_job.h"
#include "client/process/exit_status.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::string job;
  std::int64_t after = 0;
};

int watch(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  Client* client = connection->client.get();
  const auto name = full_name(client, arguments.job);
  if (!name) return print_error(name.error());
  const auto ended = follow(client, *name, arguments.after, arguments.common, OnInterrupt::LeaveJob);
  if (!ended) return ended.error();
  return deliver(client, *ended, {}, arguments.common);
}

}  // namespace

Action add_watch(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command = add_remote_command(program, "watch", "Follow a job to its end", &arguments->common);
  add_job_argument(command, &arguments->job);
  command.add("--after", &arguments->after, "Begin after the event with this sequence number; default: from the start")
      .not_negative();
  add_quiet_flag(command, &arguments->common);
  return [arguments] { return watch(*arguments); };
}

}  // namespace varimesh::client
