// varimesh logs: prints what has happened to a job.
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/time_util.h>

#include <iostream>
#include <limits>

#include "client/cli/names.h"
#include "client/commands/commands.h"
#include "client/io/progress.h"
#include "client/jobs/connection.h"
#include "client/jobs/remote_job.h"
#include "client/jobs/slide_trials.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  std::string job;
  bool follow = false;
};

/// What happened, in one line; empty if there is nothing to say.
std::string line_of(const v1::JobEvent& event, const v1::Job& job) {
  switch (event.event_case()) {
    case v1::JobEvent::kStateChange:
      return spelled(event.state_change().state());
    case v1::JobEvent::kIteration:
      return iteration_text(event.iteration(), "", "", std::numeric_limits<std::size_t>::max());
    case v1::JobEvent::kLog:
      return as_plain_text(event.log().text());
    case v1::JobEvent::kSlideTrial:
      return trial_text(event.slide_trial(), job.spec().geometry());
    case v1::JobEvent::kQuality:
      return "quality " + spelled(event.quality().stage()) + ": min Js " +
             std::to_string(event.quality().report().min_scaled_jacobian()) + ", not certified " +
             std::to_string(event.quality().report().certified().invalid() +
                            event.quality().report().certified().undecided());
    default:  // a bookmark, or an event of a newer server
      return "";
  }
}

void print_event(const v1::JobEvent& event, const v1::Job& job, bool json) {
  std::string line;
  if (json) {
    if (event.has_bookmark() || !google::protobuf::util::MessageToJsonString(event, &line).ok()) return;
  } else {
    line = line_of(event, job);
    if (line.empty()) return;
    line = google::protobuf::util::TimeUtil::ToString(event.time()) + "  " + line;
  }
  std::cout << line << std::endl;
}

int logs(const Arguments& arguments) {
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  Client* client = connection->client.get();
  const auto job = job_named(client, arguments.job);
  if (!job) return print_error(job.error());
  const std::int64_t last = arguments.follow ? std::numeric_limits<std::int64_t>::max() : job->last_sequence();
  if (last == 0) return kDone;
  const auto ended = client->watch(job->name(), 0, [&](const v1::JobEvent& event) {
    print_event(event, *job, arguments.common.json);
    return event.sequence() < last;
  });
  if (ended || !interrupted()) return ended ? int{kDone} : print_error(ended.error());
  return kInterrupted;
}

}  // namespace

Action add_logs(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command = add_remote_command(
      program, "logs", "Print what has happened to a job so far, a line for each event", &arguments->common);
  command["--json"].help("Print each event as a JSON document in a line of its own");
  add_job_argument(command, &arguments->job);
  command.add("--follow", &arguments->follow, "Go on until the job ends");
  return [arguments] { return logs(*arguments); };
}

}  // namespace varimesh::client
