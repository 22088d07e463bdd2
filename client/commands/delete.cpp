// varimesh delete: deletes a job that has ended, and its results.
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

int delete_job(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto name = full_name(connection->client.get(), arguments.job);
  if (!name) return print_error(name.error());
  if (const auto removed = connection->client->remove(*name); !removed) return print_error(removed.error());
  if (arguments.common.json) print({{"job", *name}, {"state", "deleted"}});
  return kDone;
}

}  // namespace

Action add_delete(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command =
      add_remote_command(program, "delete", "Delete a job that has ended, and its results", &arguments->common);
  add_job_argument(command, &arguments->job);
  return [arguments] { return delete_job(*arguments); };
}

}  // namespace varimesh::client
