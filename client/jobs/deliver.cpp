#include "client/jobs/deliver.h"

#include <iostream>

#include "client/io/documents.h"
#include "client/io/history.h"
#include "client/io/report_page.h"
#include "client/io/summary.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

/// Why a job failed, with the name of the file at fault.
std::string failure_text(const v1::JobError& error, const Delivery& delivery) {
  const std::string why = as_plain_text(error.message());
  const std::string of_geometry = "The geometry ";  // it begins what the server says about a CAD file
  if (!delivery.geometry.empty() && why.starts_with(of_geometry))
    return of_geometry + "'" + delivery.geometry + "' " + why.substr(of_geometry.size());
  return (error.reason() == "BAD_INPUT" && !delivery.input.empty() ? "'" + delivery.input + "': " : "") + why;
}

/// Prints how a job that has no result to deliver ended, and returns the exit status.
int print_end(const v1::Job& job, const Delivery& delivery) {
  if (job.state() == v1::JOB_STATE_FAILED) {
    std::cerr << "varimesh: " << failure_text(job.error(), delivery) << std::endl;
    return status_of_reason(job.error().reason());
  }
  if (interrupted() && job.state() == v1::JOB_STATE_CANCELLED) {
    std::cerr << "varimesh: interrupted; " << job.name() << " is cancelled and has no mesh, because it had not begun"
              << std::endl;
    return kInterrupted;
  }
  std::cerr << "varimesh: " << job.name()
            << (job.state() == v1::JOB_STATE_CANCELLED ? " was cancelled by someone else" : " has not ended")
            << std::endl;
  return kJobFailed;
}

/// Where the summary goes: standard error if a file that is written is standard output.
std::ostream& place_of_summary(const Delivery& delivery) {
  std::vector<Output> written = delivery.outputs;
  written.push_back({delivery.history});
  written.push_back({delivery.report});
  return any_is_standard_output(written) ? std::cerr : std::cout;
}

}  // namespace

int status_with_layers(const v1::Job& job, int status) {
  if (!job.spec().has_layers() || job.metrics().layers().layers() > 0) return status;
  std::cerr << "varimesh: the result has no layers, because the run "
            << (job.state() == v1::JOB_STATE_CANCELLED ? "was stopped" : "ran out of time") << " before it made them"
            << std::endl;
  return status == kDone ? kPartLeft : status;
}

int deliver(Client* client, const v1::Job& job, const Delivery& delivery, const CommonFlags& flags) {
  // A job that was cancelled while its CAD model was read has no mesh.
  const bool was_cut_short = job.state() == v1::JOB_STATE_CANCELLED && job.has_metrics() &&
                             (job.results_size() > 0 || delivery.outputs.empty());
  if (job.state() != v1::JOB_STATE_SUCCEEDED && !(was_cut_short && delivery.accepts_cancelled))
    return print_end(job, delivery);
  if (was_cut_short && !interrupted())
    std::cerr << "varimesh: " << job.name() << " was cancelled; the result is the mesh that the job had then"
              << std::endl;
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
    place_of_summary(delivery) << summary(job.metrics(), job.spec().options());
  const v1::Certified& certified = job.metrics().after().certified();
  const int status = status_with_layers(job, print_uncertified(certified.invalid(), certified.undecided()));
  if (!interrupted() || delivery.outputs.empty()) return status;
  std::cerr << "varimesh: " << interruption_text(job.metrics(), was_cut_short, delivery.outputs) << std::endl;
  return kInterrupted;
}

}  // namespace varimesh::client
