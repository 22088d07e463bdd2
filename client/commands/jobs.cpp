// varimesh jobs: lists the jobs of a server.
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <map>
#include <string>

#include "client/cli/names.h"
#include "client/commands/commands.h"
#include "client/io/documents.h"
#include "client/io/job_table.h"
#include "client/jobs/connection.h"
#include "client/jobs/remote_job.h"
#include "client/jobs/several.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::vector<std::string> labels, states;
  bool watch = false, names = false;
};

Expected<v1::ListJobsRequest> filter_of(const Arguments& arguments) {
  v1::ListJobsRequest filter;
  if (const auto labels = parse_labels(arguments.labels, filter.mutable_labels()); !labels)
    return tl::unexpected(labels.error());
  for (const std::string& name : arguments.states) {
    const auto* state = value_of(*v1::JobState_descriptor(), name);
    if (state == nullptr) return bad_option("There is no state '" + name + "'.");
    filter.add_states(static_cast<v1::JobState>(state->number()));
  }
  return filter;
}

void print_no_jobs() { std::cerr << "There are no such jobs on the server." << std::endl; }

/// The size of the terminal that standard output is; zeros if it is none.
winsize terminal() {
  winsize size{};
  if (isatty(STDOUT_FILENO) != 1 || ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0) return {};
  return size;
}

void print_table(const std::vector<v1::Job>& jobs) {
  const std::size_t width = terminal().ws_col > 0 ? terminal().ws_col : kAnyWidth;
  std::cout << job_heading(width);
  for (const v1::Job& job : jobs) std::cout << job_row(job, width);
}

/// Draws as much of the table as the terminal holds, over what was there.
void draw_table(const std::vector<v1::Job>& jobs) {
  const winsize size = terminal();
  const std::size_t rows = size.ws_row > 4 ? size.ws_row - 3U : 20U, width = size.ws_col > 0 ? size.ws_col : 80U;
  std::string picture = "\x1b[H";
  const auto add = [&](const std::string& line) { picture += line.substr(0, line.find('\n')) + "\x1b[K\n"; };
  add(job_heading(width));
  for (std::size_t i = 0; i < std::min(rows, jobs.size()); ++i) add(job_row(jobs[i], width));
  if (jobs.size() > rows) add("and " + std::to_string(jobs.size() - rows) + " more");
  std::cout << picture << "\x1b[J" << std::flush;
}

/// Shows the jobs every second until all have ended: on a terminal as a table that is drawn anew, elsewhere as one line
/// whenever the state of a job changes.
int watch(Client* client, const v1::ListJobsRequest& filter) {
  const bool draws = isatty(STDOUT_FILENO) == 1;
  if (draws) std::cout << "\x1b[2J";
  std::map<std::string, v1::JobState> shown;
  while (true) {
    const auto jobs = client->list(filter);
    if (!jobs && interrupted()) return kInterrupted;
    if (!jobs) return print_error(jobs.error());
    if (draws)
      draw_table(*jobs);
    else
      for (auto job = jobs->rbegin(); job != jobs->rend(); ++job)
        if (auto& state = shown[job->name()]; state != job->state()) {
          state = job->state();
          std::cout << job_row(*job) << std::flush;
        }
    if (jobs->empty()) print_no_jobs();
    if (std::ranges::all_of(*jobs, has_ended)) return kDone;
    sleep_unless_interrupted(std::chrono::seconds(1));
    if (interrupted()) return kInterrupted;
  }
}

int list(const Arguments& arguments) {
  const auto filter = filter_of(arguments);
  if (!filter) return print_error(filter.error());
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  if (arguments.watch) return watch(connection->client.get(), *filter);
  const auto jobs = connection->client->list(*filter);
  if (!jobs) return print_error(jobs.error());
  if (arguments.common.json) {
    Json documents = Json::array();
    for (const v1::Job& job : *jobs) documents.push_back(document(job));
    print({{"jobs", documents}});
    return kDone;
  }
  if (arguments.names) {
    for (const v1::Job& job : *jobs) std::cout << as_plain_text(job.name()) << '\n';
    return kDone;
  }
  if (jobs->empty()) {
    print_no_jobs();
    return kDone;
  }
  print_table(*jobs);
  return kDone;
}

}  // namespace

Action add_jobs(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command = add_remote_command(program, "jobs", "List the jobs of a server, newest first", &arguments->common);
  command.add("--state", &arguments->states, "List only jobs in this state; may be repeated")
      .value("STATE")
      .one_value_each();
  add_label_flag(command, &arguments->labels, "List only jobs with this label; may be repeated");
  command.add("--watch", &arguments->watch, "Show the jobs again every second until all have ended").excludes("--json");
  command.add("--names", &arguments->names, "Print only the names, one a line").excludes("--json").excludes("--watch");
  return [arguments] { return list(*arguments); };
}

}  // namespace varimesh::client
