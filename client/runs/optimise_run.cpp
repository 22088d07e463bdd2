#include "client/runs/optimise_run.h"

#include <filesystem>
#include <functional>
#include <iostream>
#include <optional>

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
#include "client/surfaces/deliver_surface.h"
#include "core/formats/reordering.h"
#include "core/mesh/check.h"
#include "core/mesh/plane.h"

namespace varimesh::client {
namespace {

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
  if (arguments.wanted_layers) *spec.mutable_layers() = *arguments.wanted_layers;
  spec.set_keep_orders(arguments.input.keep_orders);
  add_file_label(arguments.name.empty() ? arguments.input.mesh : arguments.name, spec.mutable_labels());
  for (const v1::MeshFormat format : formats_with_report(formats_of(outputs), arguments.report))
    spec.add_outputs(format);
  return spec;
}

/// Submits a job, and follows it. The error is the exit status; its message has been printed.
tl::expected<v1::Job, int> run_job(Client* client, const OptimiseArguments& arguments, const v1::JobSpec& spec) {
  const auto job = client->submit(spec, arguments.request_id);
  if (!job) return tl::unexpected(print_error(job.error()));
  const bool in_process = arguments.common.server.empty();
  return follow(client, job->name(), 0, arguments.common, in_process ? OnInterrupt::EndJob : OnInterrupt::Ask);
}

/// Whether elements may be split with these options (core/options/options.cpp).
bool may_split(const v1::Options& options) {
  const bool takes_field = options.target() == v1::TARGET_SIZE || options.target() == v1::TARGET_STRAIN;
  const bool keeps_layers =
      options.layer_spacing() == v1::LAYER_SPACING_UNSPECIFIED || options.layer_spacing() == v1::LAYER_SPACING_KEEP;
  return !takes_field && keeps_layers && options.region_below() == 0;
}

/// The order is that of the curved mesh, so nothing is left to change after that. Whoever wants a mesh of a model wants
/// a valid one, so the boundary is refined where nothing else helps.
void take_order(OptimiseArguments* arguments) {
  if (arguments->options.repair() == v1::REPAIR_UNSPECIFIED && may_split(arguments->options))
    arguments->options.set_repair(v1::REPAIR_REFINE);
  arguments->input.geometry.set_order(arguments->options.order());
  arguments->options.clear_order();
}

/// Delivers the result of a run that has ended, and returns the exit status.
int deliver_run(Client* client, const OptimiseArguments& arguments, const v1::Job& ended, std::vector<Output> outputs) {
  Delivery delivery;
  delivery.input = arguments.name.empty() ? arguments.input.mesh : arguments.name;
  delivery.geometry = arguments.input.model;
  delivery.outputs = std::move(outputs);
  delivery.history = arguments.history;
  delivery.report = arguments.report;
  delivery.accepts_cancelled = interrupted();
  const int status = deliver(client, ended, delivery, arguments.common);
  if (status != kDone && status != kPartLeft) return status;
  const std::string left = uncertified_file(delivery.outputs);
  if (left.empty()) return status;
  std::cerr << "varimesh: " << left << std::endl;
  return kInvalidLeft;
}

/// Runs the job and returns the exit status. `geometry_report` gets what came of a model.
int run(OptimiseArguments arguments, v1::GeometryReport* geometry_report) {
  if (const auto fine = check_geometry(arguments.input, arguments.options); !fine) return print_error(fine.error());
  const auto outputs = check_files(arguments);
  if (!outputs) return print_error(outputs.error());
  const bool asks_for_job = !arguments.common.server.empty() || !arguments.history.empty() || !arguments.report.empty();
  const auto connection = connect_for(arguments);
  if (!connection) return connection.error();
  Client* client = connection->client.get();
  const bool in_process = arguments.common.server.empty();
  const auto print_sentence = [&](const std::string& sentence) {
    if (!arguments.common.quiet) std::cerr << sentence << std::endl;
  };
  Input sent = arguments.input;  // without what the job does
  std::optional<formats::MeshFile> moved;
  if (in_process && sent.slides() && sent.geometry.order() == 0) {
    auto file = read_moved(sent);
    if (!file) return print_error(as_named(arguments, file.error()));
    if (is_surface(file->mesh) && !lies_in_a_plane(file->mesh)) {
      if (arguments.wanted_layers)
        return print_error({Error::Kind::BadInput,
                            "The mesh is a surface in space. Layers can be made in meshes of the plane and of space."});
      const auto slid = slide_here(sent, arguments.options, file->mesh, print_sentence);
      if (!slid) return print_error(as_named(arguments, slid.error()));
      return deliver_surface(arguments.common, asks_for_job, *outputs, *file, arguments.options.threads());
    }
    std::error_code failed;
    if (sent.changes_mesh() || !std::filesystem::is_regular_file(sent.mesh, failed))
      moved = std::move(*file);  // it is not read again: a pipe has been read to its end
  }
  v1::JobSpec spec = spec_of(arguments, *outputs);
  auto geometry = hand_over_geometry(*client, &sent);
  if (!geometry) return print_error(geometry.error());
  if (*geometry) *spec.mutable_geometry() = std::move(**geometry);
  const std::function<void()> on_read = in_process ? keep_calls_going : nullptr;
  const auto mesh = moved ? upload(*client, sent, moved, on_read) : upload(*client, sent, on_read);
  if (!mesh) return print_error(as_named(arguments, mesh.error()));
  spec.mutable_mesh()->set_digest(mesh->digest());
  const auto ended = run_job(client, arguments, spec);
  if (!ended) return ended.error();
  *geometry_report = ended->metrics().geometry();
  const int status = deliver_run(client, arguments, *ended, *outputs);
  if (ended->has_error()) say_fitting_orders(arguments.input, *ended);
  return status;
}

}  // namespace

void say_fitting_orders(const Input& input, const v1::Job& ended) {
  std::error_code failed;
  if (ended.error().reason() != "BAD_INPUT" || !std::filesystem::is_regular_file(input.mesh, failed)) return;
  const auto file = read_moved(input);
  const std::string fitting = file ? fitting_orders_text(*file) : "";
  if (!fitting.empty()) std::cerr << "varimesh: " << fitting << std::endl;
}

Expected<void> take_layers(OptimiseArguments* arguments) {
  std::string sentence;
  auto wanted = layers_of(arguments->layers, &arguments->options, &sentence);
  if (!wanted) return tl::unexpected(wanted.error());
  if (!sentence.empty() && !arguments->common.quiet) std::cerr << sentence << std::endl;
  arguments->wanted_layers = std::move(*wanted);
  return {};
}

tl::expected<Connection, int> connect_for(OptimiseArguments& arguments) {
  auto connection = connect(arguments.common);
  const bool has_model = !arguments.input.model.empty(), has_layers = arguments.wanted_layers.has_value();
  const bool asks_for_more = has_model || has_layers || arguments.input.keep_orders;
  if (!connection || arguments.common.server.empty() || !asks_for_more) return connection;
  const auto server = connection->client->info();
  if (!server) return tl::unexpected(print_error(server.error()));
  const std::string lacks = has_layers && !server->takes_layers()                    ? "is too old for layers"
                            : arguments.input.keep_orders && !server->keeps_orders() ? "is too old for --keep-orders"
                            : has_model && !server->takes_geometries()               ? "takes no geometries"
                                                                                     : "";
  if (lacks.empty()) return connection;
  if (!arguments.common.quiet) std::cerr << "The server " << lacks << ", so the job runs in this process." << std::endl;
  arguments.common.server.clear();
  return connect(arguments.common);
}

int optimise(OptimiseArguments arguments) {
  if (const auto fine = take_layers(&arguments); !fine) return print_error(fine.error());
  v1::GeometryReport geometry;
  return run(arguments, &geometry);
}

void add_run_flags(Command command, OptimiseArguments* arguments) {
  command
      .add("-o,--output", &arguments->outputs,
           "Write the result to this file (.msh, .vtu, .mesh, .xml, .su2, .h5, .cgns, .pyfrm); may be repeated")
      .value("OUT")
      .one_value_each()
      .or_standard_output();
  command.add("--format", &arguments->format, "Format of the .msh outputs; default: the format of the input")
      .value("NAME");
  add_history_flag(command, &arguments->history);
  add_report_flag(command, &arguments->report);
  add_request_id_flag(command, &arguments->request_id);
  add_server_flag(command, &arguments->common);
  add_compress_flag(command, &arguments->common);
  add_json_flag(command, &arguments->common);
  add_quiet_flag(command, &arguments->common);
  add_options(command, &arguments->options);
  add_layer_flags(command, &arguments->layers, false);
}

void add_checkpoint_flags(Command command, OptimiseArguments* arguments) {
  command
      .add("--checkpoint", &arguments->checkpoint,
           "Keep the state of the run in this file, and go on from it if it is there; removed when the run ends by "
           "itself")
      .value("FILE");
  command
      .add("--checkpoint-interval", &arguments->checkpoint_interval,
           "Save the state after the first iteration that ends this long after the last save; 60 by default")
      .value("SECONDS")
      .not_negative();
}

int check_curve(OptimiseArguments arguments) {
  arguments.common.quiet = true;  // curve() says it
  if (const auto fine = take_layers(&arguments); !fine) return print_error(fine.error());
  take_order(&arguments);
  if (const auto fine = check_geometry(arguments.input, arguments.options); !fine) return print_error(fine.error());
  const auto outputs = check_files(arguments);
  return outputs ? kDone : print_error(outputs.error());
}

int curve(OptimiseArguments arguments) {
  if (const auto fine = take_layers(&arguments); !fine) return print_error(fine.error());
  take_order(&arguments);
  v1::GeometryReport geometry;
  const int status = run(arguments, &geometry);
  if ((status == kDone || status == kPartLeft) && geometry.straight_elements() > 0) {
    std::cerr << "varimesh: curved, but " << geometry.straight_elements()
              << (geometry.straight_elements() == 1 ? " boundary element stays" : " boundary elements stay")
              << " straight" << std::endl;
    return kPartLeft;
  }
  if (status != kInvalidLeft || arguments.common.quiet) return status;
  for (const std::string& output : arguments.outputs)
    if (const std::string sentence = failed_surfaces(output, geometry); !sentence.empty()) {
      std::cerr << "varimesh: " << sentence << std::endl;
      break;
    }
  return status;
}

}  // namespace varimesh::client
