// varimesh optimise: a mesh in, an optimised one out, here or on a server.
#include "client/command/command.h"
#include "client/command/documents.h"
#include "client/command/inputs.h"
#include "client/command/job_end.h"
#include "client/command/options_table.h"
#include "client/command/outputs.h"
#include "client/command/report_command.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  Input input;
  std::vector<std::string> outputs;
  std::string format;
  std::string history, report;
  std::string request_id;
  v1::Options options;
};

int run(const Arguments& arguments) {
  // What cannot be written is found before the work starts.
  const auto outputs = check_outputs(arguments.outputs, arguments.format);
  if (!outputs) return report(outputs.error());
  if (const auto apart = check_apart(*outputs, {arguments.history, arguments.report}, arguments.common.json); !apart)
    return report(apart.error());

  auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto mesh = upload(*connection->client, arguments.input);
  if (!mesh) return report(mesh.error());
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(mesh->digest());
  *spec.mutable_options() = arguments.options;
  for (const v1::MeshFormat format : formats_with_report(formats_of(*outputs), arguments.report))
    spec.add_outputs(format);
  const auto job = connection->client->submit(spec, arguments.request_id);
  if (!job) return report(job.error());

  const auto ended = follow(connection->client.get(), job->name(), 0, arguments.common, true);
  if (!ended) return ended.error();
  return deliver(connection->client.get(), *ended,
                 {arguments.input.mesh, *outputs, arguments.history, arguments.report}, arguments.common);
}

}  // namespace

Run add_optimise(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *app.add_subcommand("optimise", "Optimise a mesh and write the result");
  add_input(command, &arguments->input);
  command.add_option("-o,--output", arguments->outputs, "Where the result goes (.msh, .vtu); may be repeated")
      ->required()
      ->type_name("OUT")
      ->allow_extra_args(false);
  command.add_option("--format", arguments->format, "Format of the .msh outputs; default as it was read")
      ->type_name("NAME");
  command.add_option("--history", arguments->history, "Write every iteration to this file, comma-separated")
      ->type_name("FILE.csv");
  add_report_flag(command, &arguments->report);
  command
      .add_option("--request-id", arguments->request_id, "Repeating with the same id on a server joins the same job")
      ->type_name("ID")
      ->check(is_text());
  add_server_flag(command, &arguments->common);
  add_compress_flag(command, &arguments->common);
  add_json_flag(command, &arguments->common);
  add_quiet_flag(command, &arguments->common);
  add_options(command, &arguments->options);
  return [arguments] { return run(*arguments); };
}

}  // namespace varimesh::client
