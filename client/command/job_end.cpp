// Watching, cancelling, delivering.
#include "client/command/job_end.h"

#include <iostream>

#include "client/command/documents.h"
#include "client/command/names.h"
#include "client/command/progress.h"

namespace varimesh::client {
namespace {

/// How a job that did not succeed ended, as the exit status.
int report_end(const v1::Job& job) {
  if (job.state() == v1::JOB_STATE_FAILED) {
    std::cerr << "varimesh: " << job.error().message() << std::endl;
    return status_of_reason(job.error().reason());
  }
  if (interrupts() > 0) {
    std::cerr << "varimesh: interrupted; " << job.name() << " is cancelled" << std::endl;
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
  double tolerance = 1e-6;
  if (const auto job = client->get(name)) {
    if (job->spec().options().has_tolerance()) tolerance = job->spec().options().tolerance();
  } else {
    return tl::unexpected(report(job.error()));
  }
  Progress progress(flags.quiet, tolerance);
  bool cancelled = false;
  auto ended = client->watch(
      name, after,
      [&](const v1::JobEvent& event) {
        progress.show(event);
        return owned || interrupts() == 0;
      },
      [&] {
        if (!owned || cancelled || interrupts() == 0) return;
        cancelled = true;
        progress.say("varimesh: interrupted; cancelling " + name);
        if (const auto answer = client->cancel(name); !answer) progress.say("varimesh: " + answer.error().sentence);
      });
  if (!ended) {
    if (interrupts() > 0) {
      std::cerr << "varimesh: interrupted; " << name << " may still run on the server" << std::endl;
      return tl::unexpected(static_cast<int>(kInterrupted));
    }
    return tl::unexpected(report(ended.error()));
  }
  if (!owned && interrupts() > 0) {
    std::cerr << "varimesh: interrupted; " << name << " runs on" << std::endl;
    return tl::unexpected(static_cast<int>(kInterrupted));
  }
  return *ended;
}

int deliver(Client* client, const v1::Job& job, const std::vector<Output>& outputs, const std::string& history,
            const CommonFlags& flags) {
  if (job.state() != v1::JOB_STATE_SUCCEEDED) return report_end(job);
  if (const auto fetched = fetch(*client, job, outputs); !fetched) return report(fetched.error());
  if (!history.empty()) {
    const auto result = client->result(job.name());
    if (!result) return report(result.error());
    if (!write_history(history, result->history))
      return report(Error{Error::Kind::Output, "The history cannot be written to '" + history + "'."});
  }
  if (flags.json)
    print(document(job.metrics()));
  else if (!flags.quiet)
    std::cout << summary(job.metrics()) << std::flush;
  return report_uncertified(job.metrics().after().certified().invalid(), job.metrics().after().certified().undecided());
}

}  // namespace varimesh::client
