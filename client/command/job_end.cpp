// Watching, cancelling, delivering.
#include "client/command/job_end.h"

#include <chrono>
#include <iostream>
#include <optional>

#include "client/command/documents.h"
#include "client/command/names.h"
#include "client/command/progress.h"
#include "client/command/report_command.h"

namespace varimesh::client {
namespace {

/// How a job that did not succeed ended, as the exit status.
int report_end(const v1::Job& job, const std::string& input, bool elsewhere) {
  if (job.state() == v1::JOB_STATE_FAILED) {
    const bool of_input = job.error().reason() == "BAD_INPUT" && !input.empty();
    std::cerr << "varimesh: " << (of_input ? "'" + input + "': " : "") << job.error().message() << std::endl;
    return status_of_reason(job.error().reason());
  }
  if (interrupts() > 0) {
    std::cerr << "varimesh: interrupted; " << job.name() << " is cancelled"
              << (elsewhere && job.has_metrics() ? "; 'varimesh result' has its mesh as it was" : "") << std::endl;
    return kInterrupted;
  }
  std::cerr << "varimesh: " << job.name()
            << (job.state() == v1::JOB_STATE_CANCELLED ? " was cancelled by someone else" : " has not ended")
            << std::endl;
  return kJobFailed;
}

}  // namespace

tl::expected<v1::Job, int> follow(Client* client, const std::string& name, std::int64_t after, const CommonFlags& flags,
                                  bool owned) {
  v1::Options options;
  if (const auto job = client->get(name)) {
    options = job->spec().options();
  } else if (!owned || interrupts() == 0) {
    return tl::unexpected(report(job.error()));  // An interrupted one of our own is cancelled below.
  }
  Progress progress(flags.quiet, options);
  // A job that runs here ends before this process can; of one that runs elsewhere enough is known after a while.
  const std::chrono::seconds patience = flags.server.empty() ? std::chrono::hours(24) : std::chrono::seconds(10);
  std::optional<std::chrono::steady_clock::time_point> cancelled;
  auto ended = client->watch(
      name, after,
      [&](const v1::JobEvent& event) {
        progress.show(event);
        return true;
      },
      [&] {
        if (interrupts() == 0) return true;
        if (!owned) return false;
        if (cancelled) return std::chrono::steady_clock::now() < *cancelled + patience;
        cancelled = std::chrono::steady_clock::now();
        progress.say("varimesh: interrupted; cancelling " + name);
        const auto answer = client->cancel(name);
        if (!answer) progress.say("varimesh: " + answer.error().sentence);
        return answer.has_value();
      });
  if (!ended) {
    if (interrupts() > 0) {
      std::cerr << "varimesh: interrupted; " << name << (owned ? " may still run on the server" : " runs on")
                << std::endl;
      return tl::unexpected(static_cast<int>(kInterrupted));
    }
    return tl::unexpected(report(ended.error()));
  }
  return *ended;
}

int deliver(Client* client, const v1::Job& job, const Delivery& delivery, const CommonFlags& flags) {
  const bool cut_short = job.state() == v1::JOB_STATE_CANCELLED && job.has_metrics();
  if (job.state() != v1::JOB_STATE_SUCCEEDED && !(cut_short && delivery.also_cancelled))
    return report_end(job, delivery.input, !flags.server.empty());
  if (cut_short)
    std::cerr << "varimesh: " << job.name() << " was cancelled; this is its mesh as it was then" << std::endl;
  if (const auto fetched = fetch(*client, job, delivery.outputs); !fetched) return report(fetched.error());
  if (!delivery.history.empty()) {
    const auto result = client->result(job.name());
    if (!result) return report(result.error());
    if (const auto written = write_history(delivery.history, result->history); !written) return report(written.error());
  }
  if (!delivery.report.empty())
    if (const auto written = write_job_report(client, job, delivery.input, delivery.report); !written)
      return report(written.error());
  if (flags.json)
    print(document(job.metrics()));
  else if (!flags.quiet)
    (take_standard_output(delivery.outputs) ? std::cerr : std::cout) << summary(job.metrics());
  return report_uncertified(job.metrics().after().certified().invalid(), job.metrics().after().certified().undecided());
}

}  // namespace varimesh::client
