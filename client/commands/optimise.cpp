// varimesh optimise: optimises a mesh, in this process or on a server.
#include <iostream>

#include "client/cli/option_flags.h"
#include "client/commands/commands.h"
#include "client/io/inputs.h"
#include "client/io/outputs.h"
#include "client/io/report_page.h"
#include "client/jobs/connection.h"
#include "client/jobs/deliver.h"
#include "client/jobs/follow.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  Input input;
  std::vector<std::string> outputs;
  std::string format, history, report, request_id;
  v1::Options options;
};

/// The input with the options that concern the geometry too. Errors: BadOption if an option does not go with a
/// geometry.
Expected<Input> with_geometry(const Arguments& arguments) {
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

int optimise(const Arguments& arguments) {
  const auto input = with_geometry(arguments);
  if (!input) return print_error(input.error());
  // Outputs that cannot be written are found before the work starts.
  const auto outputs = check_outputs(arguments.outputs, arguments.format, arguments.input.mesh);
  if (!outputs) return print_error(outputs.error());
  const auto distinct = check_distinct(*outputs, {arguments.history, arguments.report}, arguments.common.json);
  if (!distinct) return print_error(distinct.error());

  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  Client* client = connection->client.get();
  const bool in_process = arguments.common.server.empty();
  const auto print_sentence = [&](const std::string& sentence) {
    if (!arguments.common.quiet) std::cerr << sentence << std::endl;
  };
  const auto mesh = upload(*client, *input, in_process ? keep_calls_going : nullptr, print_sentence);
  if (!mesh) return print_error(mesh.error());
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(mesh->digest());
  *spec.mutable_options() = arguments.options;
  add_file_label(arguments.input.mesh, spec.mutable_labels());
  for (const v1::MeshFormat format : formats_with_report(formats_of(*outputs), arguments.report))
    spec.add_outputs(format);
  const auto job = client->submit(spec, arguments.request_id);
  if (!job) return print_error(job.error());

  const auto ended =
      follow(client, job->name(), 0, arguments.common, in_process ? OnInterrupt::EndJob : OnInterrupt::Ask);
  if (!ended) return ended.error();
  Delivery delivery;
  delivery.input = arguments.input.mesh;
  delivery.outputs = *outputs;
  delivery.history = arguments.history;
  delivery.report = arguments.report;
  delivery.accepts_cancelled = interrupted();
  return deliver(client, *ended, delivery, arguments.common);
}

}  // namespace

Action add_optimise(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *app.add_subcommand("optimise", "Optimise a mesh and write the result");
  command.alias("optimize");
  add_input(command, &arguments->input);
  add_geometry_flags(command, &arguments->input.geometry);
  command
      .add_option("-o,--output", arguments->outputs,
                  "Write the result to this file (.msh, .vtu, .mesh); may be repeated")
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
  return [arguments] { return optimise(*arguments); };
}

}  // namespace varimesh::client
