#include "client/runs/optimise_run.h"

#include <algorithm>
#include <functional>
#include <iostream>

#include "client/cli/option_flags.h"
#include "client/io/outputs.h"
#include "client/io/report_page.h"
#include "client/jobs/certified_files.h"
#include "client/jobs/connection.h"
#include "client/jobs/deliver.h"
#include "client/jobs/follow.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "client/runs/failed_surfaces.h"
#include "client/runs/other_slides.h"
#include "client/surfaces/deliver_surface.h"

namespace varimesh::client {
namespace {

constexpr double kLeastShare = 0.5;  // of the time limit: what a job gets at least after sliding

/// The outputs, after a check that all files can be written. Errors: BadOption, Output.
Expected<std::vector<Output>> check_files(const OptimiseArguments& arguments) {
  auto outputs = check_outputs(arguments.outputs, arguments.format, arguments.input.mesh);
  if (!outputs) return outputs;
  if (const auto distinct = check_distinct(*outputs, {arguments.history, arguments.report}, arguments.common.json);
      !distinct)
    return tl::unexpected(distinct.error());
  return outputs;
}

/// A failure that speaks of the mesh by its name, not by its path.
Failure as_named(const OptimiseArguments& arguments, Failure failure) {
  const std::string& path = arguments.input.mesh;
  if (const std::size_t at = failure.sentence.find(path); !arguments.name.empty() && at != std::string::npos)
    failure.sentence.replace(at, path.size(), arguments.name);
  return failure;
}

/// The job without its mesh.
v1::JobSpec spec_of(const OptimiseArguments& arguments, const std::vector<Output>& outputs) {
  v1::JobSpec spec;
  *spec.mutable_options() = arguments.options;
  add_file_label(arguments.name.empty() ? arguments.input.mesh : arguments.name, spec.mutable_labels());
  for (const v1::MeshFormat format : formats_with_report(formats_of(outputs), arguments.report))
    spec.add_outputs(format);
  return spec;
}

/// Submits a job, and follows it. `notes`: what a geometry came to, for example. The error is the exit status; its
/// message has been printed.
tl::expected<v1::Job, int> run_job(Client* client, const OptimiseArguments& arguments, const v1::JobSpec& spec,
                                   const std::string& request_id, Notes notes = Notes::Show) {
  const auto job = client->submit(spec, request_id);
  if (!job) return tl::unexpected(print_error(job.error()));
  const bool in_process = arguments.common.server.empty();
  return follow(client, job->name(), 0, arguments.common, in_process ? OnInterrupt::EndJob : OnInterrupt::Ask, notes);
}

/// Takes the seconds that sliding took in this process from the job's time limit.
void take_seconds(const MovedMesh& moved, v1::JobSpec* spec) {
  v1::Options& options = *spec->mutable_options();
  const double limit = options.time_limit();
  if (limit > 0) options.set_time_limit(std::max(kLeastShare * limit, limit - moved.seconds));
}

/// Adds what came of a model in this process to the job's metrics.
void add_geometry(const std::optional<v1::GeometryReport>& geometry, v1::Job* job) {
  if (geometry && job->has_metrics()) *job->mutable_metrics()->mutable_geometry() = *geometry;
}

/// The order is that of the curved mesh, so nothing is left to change for the job.
void take_order(OptimiseArguments* arguments) {
  arguments->input.geometry.order = arguments->options.order();
  arguments->options.clear_order();
}

/// Delivers the result of a run that has ended, and returns the exit status.
/// @param as_it_came  the mesh before its nodes slid in this process; null: none slid
int deliver_run(Client* client, const OptimiseArguments& arguments, const v1::Job& ended, std::vector<Output> outputs,
                std::shared_ptr<const HighOrderMesh> as_it_came) {
  Delivery delivery;
  delivery.input = arguments.name.empty() ? arguments.input.mesh : arguments.name;
  delivery.geometry = arguments.input.geometry.file;
  delivery.as_it_came = std::move(as_it_came);
  delivery.outputs = std::move(outputs);
  delivery.history = arguments.history;
  delivery.report = arguments.report;
  delivery.accepts_cancelled = interrupted();
  const int status = deliver(client, ended, delivery, arguments.common);
  if (status != kDone) return status;
  const std::string left = uncertified_file(delivery.outputs);
  if (left.empty()) return status;
  std::cerr << "varimesh: " << left << std::endl;
  return kInvalidLeft;
}

/// Runs the job and returns the exit status. `geometry_report` gets what came of a model.
int run(const OptimiseArguments& arguments, v1::GeometryReport* geometry_report) {
  const auto input = with_options(arguments.input, arguments.options);
  if (!input) return print_error(input.error());
  const auto outputs = check_files(arguments);
  if (!outputs) return print_error(outputs.error());

  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  Client* client = connection->client.get();
  const bool in_process = arguments.common.server.empty();
  const auto print_sentence = [&](const std::string& sentence) {
    if (!arguments.common.quiet) std::cerr << sentence << std::endl;
  };
  Input sent = *input;  // without what the server does
  sent.keeps_as_it_came = !arguments.report.empty();
  v1::JobSpec spec = spec_of(arguments, *outputs);
  if (!in_process) {
    auto geometry = hand_over_geometry(*client, &sent, print_sentence);
    if (!geometry) return print_error(geometry.error());
    if (*geometry) *spec.mutable_geometry() = std::move(**geometry);
  }
  const auto moved = moved_mesh(sent, print_sentence);
  if (!moved) return print_error(as_named(arguments, moved.error()));
  if (*moved && is_only_a_surface(sent, (*moved)->file))
    return deliver_surface(arguments.common, !in_process || !arguments.history.empty() || !arguments.report.empty(),
                           *outputs, (*moved)->file, arguments.options.threads());
  const auto mesh = upload(*client, sent, *moved, in_process ? keep_calls_going : nullptr);
  if (!mesh) return print_error(as_named(arguments, mesh.error()));
  spec.mutable_mesh()->set_digest(mesh->digest());
  if (*moved) take_seconds(**moved, &spec);
  auto ended = run_job(client, arguments, spec, arguments.request_id);
  if (!ended) return ended.error();
  if (*moved) add_geometry((*moved)->geometry, &*ended);
  if (input->geometry.any()) {
    const auto run_other = [&](const v1::JobSpec& other, const std::string& request_id) {
      return run_job(client, arguments, other, request_id, Notes::LeaveOut);
    };
    *ended = best_of_other_slides({*client, *input, std::move(spec), arguments.request_id, run_other, print_sentence},
                                  std::move(*ended));
  }
  *geometry_report = ended->metrics().geometry();
  return deliver_run(client, arguments, *ended, *outputs, *moved ? (*moved)->as_it_came : nullptr);
}

}  // namespace

int optimise(const OptimiseArguments& arguments) {
  v1::GeometryReport geometry;
  return run(arguments, &geometry);
}

void add_run_flags(Command command, OptimiseArguments* arguments) {
  command
      .add("-o,--output", &arguments->outputs,
           "Write the result to this file (.msh, .vtu, .mesh, .xml, .su2, .h5, .cgns, .pyfrm); may be repeated")
      .required()
      .value("OUT")
      .one_value_each();
  command.add("--format", &arguments->format, "Format of the .msh outputs; default: that of the input").value("NAME");
  add_history_flag(command, &arguments->history);
  add_report_flag(command, &arguments->report);
  add_request_id_flag(command, &arguments->request_id);
  add_server_flag(command, &arguments->common);
  add_compress_flag(command, &arguments->common);
  add_json_flag(command, &arguments->common);
  add_quiet_flag(command, &arguments->common);
  add_options(command, &arguments->options);
}

int check_curve(OptimiseArguments arguments) {
  take_order(&arguments);
  if (const auto input = with_options(arguments.input, arguments.options); !input) return print_error(input.error());
  const auto outputs = check_files(arguments);
  return outputs ? kDone : print_error(outputs.error());
}

int curve(OptimiseArguments arguments) {
  take_order(&arguments);
  v1::GeometryReport geometry;
  const int status = run(arguments, &geometry);
  if (status != kInvalidLeft || arguments.common.quiet) return status;
  for (const std::string& output : arguments.outputs)
    if (const std::string sentence = failed_surfaces(output, geometry); !sentence.empty()) {
      std::cerr << "varimesh: " << sentence << std::endl;
      break;
    }
  return status;
}

}  // namespace varimesh::client
