#include "client/jobs/optimise_run.h"

#include <iostream>

#include "client/cli/option_flags.h"
#include "client/io/outputs.h"
#include "client/io/report_page.h"
#include "client/jobs/certified_files.h"
#include "client/jobs/connection.h"
#include "client/jobs/deliver.h"
#include "client/jobs/failed_surfaces.h"
#include "client/jobs/follow.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"

namespace varimesh::client {
namespace {

/// The input with the options that concern the geometry too. Errors: BadOption if an option does not go with a
/// geometry.
Expected<Input> with_geometry(const OptimiseArguments& arguments) {
  Input input = arguments.input;
  if (input.geometry.file.empty()) return input;
  const v1::Options& options = arguments.options;
  if (options.order() > 0)
    return bad_option("--order does not go with --geometry, because new boundary nodes would not lie on it.");
  if (options.free_size() > 0 || options.free_nodes_size() > 0 || options.fix_nodes_size() > 0 ||
      options.region_below() > 0)
    return bad_option("--geometry goes only with --fix, not with other options that fix or free nodes.");
  input.geometry.fix.assign(options.fix().begin(), options.fix().end());
  input.geometry.threads = options.threads();
  return input;
}

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

/// The order is that of the curved mesh, so nothing is left to change for the job.
void take_order(OptimiseArguments* arguments) {
  arguments->input.geometry.order = arguments->options.order();
  arguments->options.clear_order();
}

}  // namespace

int optimise(const OptimiseArguments& arguments) {
  const auto input = with_geometry(arguments);
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
  const auto mesh = upload(*client, *input, in_process ? keep_calls_going : nullptr, print_sentence);
  if (!mesh) return print_error(as_named(arguments, mesh.error()));
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(mesh->digest());
  *spec.mutable_options() = arguments.options;
  const std::string& name = arguments.name.empty() ? arguments.input.mesh : arguments.name;
  add_file_label(name, spec.mutable_labels());
  for (const v1::MeshFormat format : formats_with_report(formats_of(*outputs), arguments.report))
    spec.add_outputs(format);
  const auto job = client->submit(spec, arguments.request_id);
  if (!job) return print_error(job.error());

  const auto ended =
      follow(client, job->name(), 0, arguments.common, in_process ? OnInterrupt::EndJob : OnInterrupt::Ask);
  if (!ended) return ended.error();
  Delivery delivery;
  delivery.input = name;
  delivery.outputs = *outputs;
  delivery.history = arguments.history;
  delivery.report = arguments.report;
  delivery.accepts_cancelled = interrupted();
  const int status = deliver(client, *ended, delivery, arguments.common);
  if (status != kDone) return status;
  const std::string left = uncertified_file(*outputs);
  if (left.empty()) return status;
  std::cerr << "varimesh: " << left << std::endl;
  return kInvalidLeft;
}

void add_run_flags(CLI::App& command, OptimiseArguments* arguments) {
  command
      .add_option("-o,--output", arguments->outputs,
                  "Write the result to this file (.msh, .vtu, .mesh, .xml, .su2, .h5, .cgns, .pyfrm); may be repeated")
      ->required()
      ->type_name("OUT")
      ->allow_extra_args(false);
  command.add_option("--format", arguments->format, "Format of the .msh outputs; default: that of the input")
      ->type_name("NAME");
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
  if (const auto input = with_geometry(arguments); !input) return print_error(input.error());
  const auto outputs = check_files(arguments);
  return outputs ? kDone : print_error(outputs.error());
}

int curve(OptimiseArguments arguments) {
  take_order(&arguments);
  const int status = optimise(arguments);
  if (status != kInvalidLeft || arguments.common.quiet) return status;
  for (const std::string& output : arguments.outputs)
    if (const std::string sentence = failed_surfaces(output); !sentence.empty()) {
      std::cerr << "varimesh: " << sentence << std::endl;
      break;
    }
  return status;
}

}  // namespace varimesh::client
