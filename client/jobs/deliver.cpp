#include "client/jobs/deliver.h"

#include <iostream>

#include "client/io/documents.h"
#include "client/io/history.h"
#include "client/io/report_page.h"
#include "client/io/summary.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"

namespace varimesh::client {
namespace {

/// Prints how a job that did not succeed ended, and returns the exit status. `on_server`: not in this process.
int print_end(const v1::Job& job, const std::string& input, bool on_server) {
  if (job.state() == v1::JOB_STATE_FAILED) {
    const bool concerns_input = job.error().reason() == "BAD_INPUT" && !input.empty();
    std::cerr << "varimesh: " << (concerns_input ? "'" + input + "': " : "") << job.error().message() << std::endl;
    return status_of_reason(job.error().reason());
  }
  if (interrupt_count() > 0) {
    std::cerr << "varimesh: interrupted; " << job.name() << " is cancelled"
              << (on_server && job.has_metrics() ? "; 'varimesh result' fetches the mesh that it had" : "")
              << std::endl;
    return kInterrupted;
  }
  std::cerr << "varimesh: " << job.name()
            << (job.state() == v1::JOB_STATE_CANCELLED ? " was cancelled by someone else" : " has not ended")
            << std::endl;
  return kJobFailed;
}

}  // namespace

int deliver(Client* client, const v1::Job& job, const Delivery& delivery, const CommonFlags& flags) {
  const bool was_cut_short = job.state() == v1::JOB_STATE_CANCELLED && job.has_metrics();
  if (job.state() != v1::JOB_STATE_SUCCEEDED && !(was_cut_short && delivery.accepts_cancelled))
    return print_end(job, delivery.input, !flags.server.empty());
  if (was_cut_short)
    std::cerr << "varimesh: " << job.name() << " was cancelled; the result is the mesh that it had then" << std::endl;
  if (const auto fetched = fetch(*client, job, delivery.outputs); !fetched) return print_error(fetched.error());
  if (!delivery.history.empty()) {
    const auto result = client->result(job.name());
    if (!result) return print_error(result.error());
    if (const auto written = write_history(delivery.history, result->history); !written)
      return print_error(written.error());
  }
  if (!delivery.report.empty())
    if (const auto written = write_job_report(client, job, delivery.input, delivery.report); !written)
      return print_error(written.error());
  if (flags.json)
    print(document(job.metrics()));
  else if (!flags.quiet)
    (any_is_standard_output(delivery.outputs) ? std::cerr : std::cout) << summary(job.metrics());
  const v1::Certified& certified = job.metrics().after().certified();
  return print_uncertified(certified.invalid(), certified.undecided());
}

}  // namespace varimesh::client
