// varimesh submit, watch, result, cancel, delete, jobs, info: what a server's jobs can be told and asked.
#include <fmt/format.h>

#include <iostream>

#include "client/command/command.h"
#include "client/command/documents.h"
#include "client/command/inputs.h"
#include "client/command/job_end.h"
#include "client/command/names.h"
#include "client/command/options_table.h"
#include "client/command/outputs.h"
#include "client/command/report_command.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  Input input;
  std::string job, format, history, report, request_id;
  std::vector<std::string> outputs, labels, states;
  std::int64_t after = 0;
  int priority = 0;
  v1::Options options;
};

std::shared_ptr<Arguments> new_arguments() { return std::make_shared<Arguments>(); }

/// Flags of a subcommand that only makes sense with a server.
CLI::App& add_remote(CLI::App& app, const char* name, const char* help, Arguments* arguments) {
  CLI::App& command = *app.add_subcommand(name, help);
  command.add_option("--server", arguments->common.server, "HOST:PORT or unix:PATH of a varimeshd")
      ->required()
      ->type_name("ADDRESS");
  add_json_flag(command, &arguments->common);
  return command;
}

/// A job's name may be given without its "jobs/".
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

int submit(const Arguments& arguments) {
  v1::JobSpec spec;
  if (const auto labels = parse_labels(arguments.labels, spec.mutable_labels()); !labels) return report(labels.error());
  *spec.mutable_options() = arguments.options;
  spec.set_priority(arguments.priority);
  for (const std::string& name : arguments.outputs) {
    const auto* format = value_of(*v1::MeshFormat_descriptor(), name);
    if (format == nullptr) return report(Error{Error::Kind::BadOption, "There is no format '" + name + "'."});
    spec.add_outputs(static_cast<v1::MeshFormat>(format->number()));
  }
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto mesh = upload(*connection->client, arguments.input);
  if (!mesh) return report(mesh.error());
  spec.mutable_mesh()->set_digest(mesh->digest());
  const auto job = connection->client->submit(spec, arguments.request_id);
  if (!job) return report(job.error());
  if (arguments.common.json)
    print(document(*job));
  else
    std::cout << job->name() << '\n';
  return kDone;
}

int watch(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto ended =
      follow(connection->client.get(), full_name(arguments.job), arguments.after, arguments.common, false);
  if (!ended) return ended.error();
  return deliver(connection->client.get(), *ended, {}, arguments.common);
}

int result(const Arguments& arguments) {
  const auto outputs = check_outputs(arguments.outputs, arguments.format);
  if (!outputs) return report(outputs.error());
  if (const auto apart = check_apart(*outputs, {arguments.history, arguments.report}, arguments.common.json); !apart)
    return report(apart.error());
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto job = connection->client->get(full_name(arguments.job));
  if (!job) return report(job.error());
  return deliver(connection->client.get(), *job, {"", *outputs, arguments.history, arguments.report, true},
                 arguments.common);
}

int cancel(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto job = connection->client->cancel(full_name(arguments.job));
  if (!job) return report(job.error());
  if (arguments.common.json)
    print(document(*job));
  else
    std::cout << job->name() << ' ' << spelled(job->state()) << '\n';
  return kDone;
}

int remove(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const std::string name = full_name(arguments.job);
  if (const auto removed = connection->client->remove(name); !removed) return report(removed.error());
  if (arguments.common.json) print({{"job", name}, {"state", "deleted"}});
  return kDone;
}

int list(const Arguments& arguments) {
  v1::ListJobsRequest filter;
  if (const auto labels = parse_labels(arguments.labels, filter.mutable_labels()); !labels)
    return report(labels.error());
  for (const std::string& name : arguments.states) {
    const auto* state = value_of(*v1::JobState_descriptor(), name);
    if (state == nullptr) return report(Error{Error::Kind::BadOption, "There is no state '" + name + "'."});
    filter.add_states(static_cast<v1::JobState>(state->number()));
  }
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto jobs = connection->client->list(filter);
  if (!jobs) return report(jobs.error());
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

int info(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto answer = connection->client->info();
  if (!answer) return report(answer.error());
  const Json facts = document(*answer);
  if (arguments.common.json) {
    print(facts);
    return kDone;
  }
  for (const auto& [key, value] : facts.items()) {
    std::string text = value.is_string() ? value.get<std::string>() : "";
    if (value.is_array())
      for (const auto& one : value) text += (text.empty() ? "" : ", ") + one.get<std::string>();
    std::cout << fmt::format("{:<27}{}\n", key, text.empty() ? value.dump() : text);
  }
  return kDone;
}

}  // namespace

Run add_submit(CLI::App& app) {
  auto arguments = new_arguments();
  CLI::App& command = add_remote(app, "submit", "Send a mesh to a server and print the job's name", arguments.get());
  add_input(command, &arguments->input);
  command.add_option("--output-format", arguments->outputs, "Formats of the result; default as it was read")
      ->allow_extra_args(false);
  command.add_option("--label", arguments->labels, "KEY=VALUE to find the job by; may be repeated")
      ->check(is_text())
      ->allow_extra_args(false);
  command
      .add_option("--priority", arguments->priority,
                  "Higher goes first, from -100 to 100: a step is worth ten minutes of waiting")
      ->check(CLI::Range(-100, 100))
      ->capture_default_str();
  command.add_option("--request-id", arguments->request_id, "Repeating with the same id answers with the same job")
      ->check(is_text());
  add_compress_flag(command, &arguments->common);
  add_options(command, &arguments->options);
  return [arguments] { return submit(*arguments); };
}

Run add_watch(CLI::App& app) {
  auto arguments = new_arguments();
  CLI::App& command = add_remote(app, "watch", "Follow a job to its end", arguments.get());
  command.add_option("job", arguments->job, "Its name")->required()->type_name("JOB")->check(is_text());
  command.add_option("--after", arguments->after, "Sequence number of the last event that was seen")
      ->check(CLI::NonNegativeNumber);
  add_quiet_flag(command, &arguments->common);
  return [arguments] { return watch(*arguments); };
}

Run add_result(CLI::App& app) {
  auto arguments = new_arguments();
  CLI::App& command = add_remote(
      app, "result", "Fetch the result of a job that has succeeded, or was cancelled while it ran", arguments.get());
  command.add_option("job", arguments->job, "Its name")->required()->type_name("JOB")->check(is_text());
  command.add_option("-o,--output", arguments->outputs, "Where it goes; may be repeated")
      ->type_name("OUT")
      ->allow_extra_args(false);
  command.add_option("--format", arguments->format, "Which of the job's formats; default as it was read");
  command.add_option("--history", arguments->history, "Write every iteration to this file, comma-separated")
      ->type_name("FILE.csv");
  add_report_flag(command, &arguments->report);
  add_compress_flag(command, &arguments->common);
  add_quiet_flag(command, &arguments->common);
  return [arguments] { return result(*arguments); };
}

Run add_cancel(CLI::App& app) {
  auto arguments = new_arguments();
  CLI::App& command = add_remote(app, "cancel", "Ask for a job to end", arguments.get());
  command.add_option("job", arguments->job, "Its name")->required()->type_name("JOB")->check(is_text());
  return [arguments] { return cancel(*arguments); };
}

Run add_delete(CLI::App& app) {
  auto arguments = new_arguments();
  CLI::App& command = add_remote(app, "delete", "Forget a job that has ended, and its results", arguments.get());
  command.add_option("job", arguments->job, "Its name")->required()->type_name("JOB")->check(is_text());
  return [arguments] { return remove(*arguments); };
}

Run add_jobs(CLI::App& app) {
  auto arguments = new_arguments();
  CLI::App& command = add_remote(app, "jobs", "List a server's jobs, newest first", arguments.get());
  command.add_option("--state", arguments->states, "Only those in this state; may be repeated")
      ->allow_extra_args(false);
  command.add_option("--label", arguments->labels, "Only those with this KEY=VALUE; may be repeated")
      ->check(is_text())
      ->allow_extra_args(false);
  return [arguments] { return list(*arguments); };
}

Run add_info(CLI::App& app) {
  auto arguments = new_arguments();
  CLI::App& command = *app.add_subcommand("info", "What a server is and takes; without --server, this program");
  add_server_flag(command, &arguments->common);
  add_json_flag(command, &arguments->common);
  return [arguments] { return info(*arguments); };
}

}  // namespace varimesh::client
