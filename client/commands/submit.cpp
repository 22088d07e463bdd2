// varimesh submit: sends a mesh to a server and prints the name of the job.
#include <iostream>

#include "client/cli/names.h"
#include "client/cli/option_flags.h"
#include "client/commands/commands.h"
#include "client/commands/remote_job.h"
#include "client/io/documents.h"
#include "client/io/inputs.h"
#include "client/jobs/connection.h"
#include "client/process/exit_status.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  Input input;
  std::string request_id;
  std::vector<std::string> formats, labels;
  int priority = 0;
  v1::Options options;
};

Expected<v1::JobSpec> job_spec(const Arguments& arguments) {
  v1::JobSpec spec;
  if (const auto labels = parse_labels(arguments.labels, spec.mutable_labels()); !labels)
    return tl::unexpected(labels.error());
  add_file_label(arguments.input.mesh, spec.mutable_labels());
  *spec.mutable_options() = arguments.options;
  spec.set_priority(arguments.priority);
  for (const std::string& name : arguments.formats) {
    const auto* format = value_of(*v1::MeshFormat_descriptor(), name);
    if (format == nullptr) return bad_option("There is no format '" + name + "'.");
    spec.add_outputs(static_cast<v1::MeshFormat>(format->number()));
  }
  return spec;
}

int submit(const Arguments& arguments) {
  auto spec = job_spec(arguments);
  if (!spec) return print_error(spec.error());
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  const auto mesh = upload(*connection->client, arguments.input);
  if (!mesh) return print_error(mesh.error());
  spec->mutable_mesh()->set_digest(mesh->digest());
  const auto job = connection->client->submit(*spec, arguments.request_id);
  if (!job) return print_error(job.error());
  if (arguments.common.json)
    print(document(*job));
  else
    std::cout << job->name() << '\n';
  return kDone;
}

}  // namespace

Action add_submit(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command =
      add_remote_command(app, "submit", "Send a mesh to a server and print the name of the job", &arguments->common);
  add_input(command, &arguments->input);
  command
      .add_option("--output-format", arguments->formats,
                  "Format of the result; default: that of the input; may be repeated")
      ->type_name("NAME")
      ->allow_extra_args(false);
  add_label_flag(command, &arguments->labels, "Label by which jobs can be listed; may be repeated");
  command
      .add_option(
          "--priority", arguments->priority,
          "From -100 to 100; jobs with a higher priority go first, and a step counts like ten minutes of waiting")
      ->check(CLI::Range(-100, 100))
      ->capture_default_str();
  add_request_id_flag(command, &arguments->request_id);
  add_compress_flag(command, &arguments->common);
  add_options(command, &arguments->options);
  return [arguments] { return submit(*arguments); };
}

}  // namespace varimesh::client
