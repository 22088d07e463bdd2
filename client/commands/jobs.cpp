// varimesh jobs: lists the jobs of a server.
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include <ctime>
#include <iostream>
#include <map>
#include <string>

#include "client/cli/names.h"
#include "client/commands/commands.h"
#include "client/commands/remote_job.h"
#include "client/io/documents.h"
#include "client/jobs/connection.h"
#include "client/process/exit_status.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::vector<std::string> labels, states;
};

std::string row(const std::string& job, const std::string& state, const std::string& submitted,
                const std::string& seconds, const std::string& iterations, const std::string& words) {
  std::string line =
      fmt::format("{:<24}  {:<10}  {:<19}  {:>8}  {:>10}  {}", job, state, submitted, seconds, iterations, words);
  line.erase(line.find_last_not_of(' ') + 1);
  return line + "\n";
}

/// The time in the time zone of this machine: 2026-01-31 14:05:59.
std::string local_time(const google::protobuf::Timestamp& time) {
  const std::time_t seconds = time.seconds();
  std::tm parts{};
  if (seconds == 0 || localtime_r(&seconds, &parts) == nullptr) return "";
  return fmt::format("{:%Y-%m-%d %H:%M:%S}", parts);
}

/// How long the job has run, in seconds; empty if it has not begun.
std::string time_run(const v1::Job& job) {
  if (!job.has_start_time()) return "";
  using google::protobuf::util::TimeUtil;
  const auto end = job.has_end_time() ? job.end_time() : TimeUtil::GetCurrentTime();
  return fmt::format("{:.1f} s", static_cast<double>(TimeUtil::DurationToMilliseconds(end - job.start_time())) / 1000);
}

/// The name of the file, then the other labels. Words of others are made harmless for the terminal.
std::string words_about(const v1::Job& job) {
  std::map<std::string, std::string> labels(job.spec().labels().begin(), job.spec().labels().end());
  std::string words = labels["file"];
  labels.erase("file");
  for (const auto& [key, value] : labels) words += (words.empty() ? "" : "  ") + key + "=" + value;
  return as_plain_text(words);
}

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
  if (jobs->empty()) {
    std::cerr << "There are no such jobs on the server." << std::endl;
    return kDone;
  }
  std::cout << row("JOB", "STATE", "SUBMITTED", "RAN", "ITERATIONS", "FILE AND LABELS");
  for (const v1::Job& job : *jobs)
    std::cout << row(as_plain_text(job.name()), spelled(job.state()), local_time(job.create_time()), time_run(job),
                     std::to_string(job.has_metrics() ? job.metrics().iterations() : job.iteration().number()),
                     words_about(job));
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
