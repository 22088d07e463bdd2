// varimesh submit: sends meshes to a server and prints the names of the jobs.
#include <filesystem>
#include <iostream>
#include <set>

#include "client/cli/names.h"
#include "client/cli/option_flags.h"
#include "client/commands/commands.h"
#include "client/io/documents.h"
#include "client/io/inputs.h"
#include "client/jobs/connection.h"
#include "client/jobs/remote_job.h"
#include "client/process/exit_status.h"
#include "client/runs/layer_flags.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

struct Arguments {
  CommonFlags common;
  Input input;                      ///< What all meshes have in common; `mesh` is empty.
  std::vector<std::string> meshes;  ///< Paths.
  std::string request_id;
  std::vector<std::string> formats, labels;
  int priority = 0;
  std::string webhook;
  v1::Options options;
  LayerFlags layers;
};

void print_sentence(const std::string& sentence) { std::cerr << sentence << std::endl; }

/// What all jobs have in common.
Expected<v1::JobSpec> job_spec(const Arguments& arguments) {
  v1::JobSpec spec;
  if (const auto labels = parse_labels(arguments.labels, spec.mutable_labels()); !labels)
    return tl::unexpected(labels.error());
  *spec.mutable_options() = arguments.options;
  spec.set_priority(arguments.priority);
  spec.set_keep_orders(arguments.input.keep_orders);
  if (!arguments.webhook.empty()) spec.mutable_webhook()->set_url(arguments.webhook);
  for (const std::string& name : arguments.formats) {
    const auto* format = value_of(*v1::MeshFormat_descriptor(), name);
    if (format == nullptr) return bad_option("There is no format '" + name + "'.");
    spec.add_outputs(static_cast<v1::MeshFormat>(format->number()));
  }
  return spec;
}

/// Takes the layers from their flags. Errors: BadOption.
Expected<void> take_layers(const Arguments& arguments, v1::JobSpec* spec) {
  std::string sentence;
  auto wanted = layers_of(arguments.layers, spec->mutable_options(), &sentence);
  if (!wanted) return tl::unexpected(wanted.error());
  if (!sentence.empty()) print_sentence(sentence);
  if (*wanted) *spec->mutable_layers() = std::move(**wanted);
  return {};
}

/// Several meshes are told apart by the names of their files: in the labels, and in the request ids.
Expected<void> check_meshes(const Arguments& arguments) {
  if (arguments.meshes.size() == 1) return {};
  if (!arguments.input.displacements.empty() || !arguments.input.boundary.empty())
    return bad_option("--displacements and --boundary belong to one mesh; submit the meshes one by one.");
  if (arguments.request_id.empty()) return {};
  std::set<std::string> names;
  for (const std::string& path : arguments.meshes)
    if (const std::string name = std::filesystem::path(path).filename().string(); !names.insert(name).second)
      return bad_option("Two meshes have the file name " + name +
                        ", so --request-id cannot tell them apart; submit them one by one, each with an id.");
  return {};
}

/// Uploads a mesh, after its nodes have slid in this process if the server cannot do that.
Outcome<v1::StoredMesh> upload_slid(Client& client, const Arguments& arguments, const Input& input) {
  if (!input.slides()) return upload(client, input);
  auto mesh = read_moved(input);
  if (!mesh) return tl::unexpected(mesh.error());
  if (const auto slid = slide_here(input, arguments.options, mesh->mesh, print_sentence); !slid)
    return tl::unexpected(slid.error());
  return upload(client, input, std::optional(std::move(*mesh)), {});
}

/// Uploads a mesh and submits its job. `input`: what all meshes have in common. The error is the exit status; its
/// message has been printed.
tl::expected<v1::Job, int> submit(Client* client, const Arguments& arguments, Input input, const std::string& path,
                                  v1::JobSpec spec) {
  input.mesh = path;
  add_file_label(path, spec.mutable_labels());
  const auto mesh = upload_slid(*client, arguments, input);
  if (!mesh) return tl::unexpected(print_error(mesh.error()));
  spec.mutable_mesh()->set_digest(mesh->digest());
  std::string request_id = arguments.request_id;
  if (!request_id.empty() && arguments.meshes.size() > 1)
    request_id += ":" + std::filesystem::path(path).filename().string();
  auto job = client->submit(spec, request_id);
  if (!job) return tl::unexpected(print_error(job.error()));
  return *job;
}

/// Checks that the server knows what the spec asks for: an older one would leave it out without a word. Returns the
/// exit status, after a message; kDone: it does.
int check_server(Client& client, const v1::JobSpec& spec) {
  if (!spec.has_layers() && !spec.has_webhook() && !spec.keep_orders()) return kDone;
  const auto server = client.info();
  if (!server) return print_error(server.error());
  if (spec.has_layers() && !server->takes_layers())
    return print_error(
        bad_option("The server is too old for layers. Split the result with 'varimesh layers'.").value());
  if (spec.keep_orders() && !server->keeps_orders())
    return print_error(bad_option("The server is too old for --keep-orders. Leave the flag out, or use 'varimesh "
                                  "optimise'.")
                           .value());
  if (spec.has_webhook() && !server->takes_webhooks())
    return print_error(bad_option("The server calls nobody at the end of a job; leave out --webhook, or ask its "
                                  "operator to start it with --webhooks.")
                           .value());
  return kDone;
}

int submit(const Arguments& arguments) {
  if (const auto fine = check_meshes(arguments); !fine) return print_error(fine.error());
  auto spec = job_spec(arguments);
  if (!spec) return print_error(spec.error());
  if (const auto fine = take_layers(arguments, &*spec); !fine) return print_error(fine.error());
  if (const auto fine = check_geometry(arguments.input, arguments.options); !fine) return print_error(fine.error());
  Input input = arguments.input;  // without what the jobs do
  const auto connection = connect(arguments.common);
  if (!connection) return connection.error();
  auto geometry = hand_over_geometry(*connection->client, &input);
  if (!geometry) return print_error(geometry.error());
  if (input.slides()) print_sentence("The server takes no geometries, so the boundary nodes slide in this process.");
  if (*geometry) *spec->mutable_geometry() = std::move(**geometry);
  if (const int refused = check_server(*connection->client, *spec); refused != kDone) return refused;
  Json documents = Json::array();
  int status = kDone;
  for (const std::string& path : arguments.meshes) {
    const auto job = submit(connection->client.get(), arguments, input, path, *spec);
    if (!job) {
      if (status == kDone) status = job.error();
      // A mesh that is refused is no reason to leave the others out; a server that is lost is.
      if (job.error() == kServer || job.error() == kInterrupted) break;
      if (arguments.meshes.size() > 1)
        std::cerr << "varimesh: " << as_plain_text(path) << " was not submitted" << std::endl;
      continue;
    }
    if (arguments.common.json)
      documents.push_back(document(*job));
    else
      std::cout << job->name() << std::endl;
  }
  if (arguments.common.json && arguments.meshes.size() > 1) print({{"jobs", documents}});
  if (arguments.common.json && arguments.meshes.size() == 1 && !documents.empty()) print(documents.front());
  return status;
}

}  // namespace

Action add_submit(Command program) {
  auto arguments = std::make_shared<Arguments>();
  Command command = add_remote_command(program, "submit", "Send meshes to a server and print the names of the jobs",
                                       &arguments->common);
  add_inputs(command, &arguments->meshes, &arguments->input);
  add_geometry_flags(command, &arguments->input, true);
  command
      .add("--output-format", &arguments->formats,
           "Format of the result; default: the format of the input; may be repeated")
      .value("NAME")
      .one_value_each();
  add_label_flag(command, &arguments->labels, "Label by which jobs can be listed; may be repeated");
  command
      .add("--priority", &arguments->priority,
           "From -100 to 100; jobs with a higher priority go first, and one step counts as much as ten minutes of "
           "waiting")
      .from(-100, 100)
      .shows_default();
  command
      .add("--webhook", &arguments->webhook,
           "Address that the server calls when a job has ended; the server's operator says which addresses it may call")
      .value("URL");
  add_request_id_flag(command, &arguments->request_id);
  add_compress_flag(command, &arguments->common);
  add_keep_orders_flag(command, &arguments->input.keep_orders);
  add_options(command, &arguments->options);
  add_layer_flags(command, &arguments->layers, false);
  return [arguments] { return submit(*arguments); };
}

}  // namespace varimesh::client
