// varimesh results: fetches the results of several jobs into a folder.
#include <iostream>

#include "client/cli/names.h"
#include "client/commands/commands.h"
#include "client/io/documents.h"
#include "client/io/job_table.h"
#include "client/jobs/connection.h"
#include "client/jobs/remote_job.h"
#include "client/jobs/result_files.h"
#include "client/jobs/selection.h"
#include "client/jobs/several.h"
#include "client/process/exit_status.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  Selection selection;
  std::string into;
};

/// Fetches one result, unless it is there. Returns the exit status if this fails; its message has been printed.
tl::expected<void, int> fetch(Client* client, const ResultFile& file) {
  const auto there = what_is_at(file);
  if (!there) return tl::unexpected(print_error(there.error()));
  if (*there == AtPath::TheResult) return {};
  if (*there == AtPath::Another)
    return tl::unexpected(print_error(
        Error{Error::Kind::Output, "There is another file at " + file.path.string() + " already, so " +
                                       file.job->name() + " was not fetched; remove it, or name another folder."}));
  if (const auto done = client->download(file.mesh, file.path.string()); !done)
    return tl::unexpected(print_error(done.error()));
  return {};
}

/// The document of a job with its files.
Json document_with(const v1::Job& job, const std::vector<std::string>& files) {
  Json result = document(job);
  result["files"] = files;
  return result;
}

int results(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  Client* client = connection->client.get();
  const auto jobs = chosen(client, arguments.selection);
  if (!jobs) return print_error(jobs.error());
  if (const auto made = make_folder(arguments.into); !made) return print_error(made.error());

  Endings endings;
  std::map<std::string, std::vector<std::string>> files_of;  // By the names of the jobs.
  std::size_t running = 0;
  int worst = kDone;
  for (const ResultFile& file : result_files(*jobs, arguments.into)) {
    const auto done = fetch(client, file);
    if (!done && (done.error() == kServer || done.error() == kInterrupted)) return done.error();
    if (!done)
      worst = done.error();
    else
      files_of[file.job->name()].push_back(file.path.string());
  }
  Json documents = Json::array();
  for (const v1::Job& job : *jobs) {
    if (has_ended(job))
      endings.add(job);
    else
      ++running;
    const auto& files = files_of[job.name()];
    if (arguments.common.json) documents.push_back(document_with(job, files));
    if (arguments.common.json || arguments.common.quiet) continue;
    for (const std::string& file : files)
      std::cout << as_plain_text(file) << "  " << as_plain_text(job.name()) << "  " << ending_of(job) << '\n';
    if (!has_result(job))
      std::cerr << as_plain_text(job.name()) << "  " << spelled(job.state()) << "  " << words_about(job) << "  "
                << (has_ended(job) ? ending_of(job) : "it has not ended") << '\n';
  }
  if (arguments.common.json)
    print({{"jobs", documents}});
  else if (!arguments.common.quiet && running < jobs->size())
    std::cerr << endings.sentence() << std::endl;
  if (running > 0)
    std::cerr << "varimesh: " << running << (running == 1 ? " job has" : " jobs have")
              << " not ended; wait for them with 'varimesh wait', and fetch the rest then" << std::endl;
  if (worst != kDone) return worst;
  return running > 0 ? int{kJobFailed} : endings.exit_status();
}

}  // namespace

Action add_results(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command =
      add_remote_command(program, "results", "Fetch the results of several jobs into a folder", &arguments->common);
  add_selection(command, &arguments->selection);
  command
      .add("--into", &arguments->into,
           "The folder for the results; it is made if it does not exist. Files that it has already are not fetched "
           "again")
      .value("DIR")
      .required();
  add_compress_flag(command, &arguments->common);
  add_quiet_flag(command, &arguments->common);
  return [arguments] { return results(*arguments); };
}

}  // namespace varimesh::client
