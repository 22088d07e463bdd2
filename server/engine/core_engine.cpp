// Reads a mesh, optimises it with the numerical library, and writes the results.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "core/association/association.h"
#include "core/association/plane/flattened.h"
#include "core/association/plane/profile.h"
#include "core/base/io/allowance.h"
#include "core/base/stop_token.h"
#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/diagnosis/diagnose.h"
#include "core/formats/reading_notes.h"
#include "core/formats/usual_memory.h"
#include "core/geometry/load.h"
#include "core/layers/grow/grow_layer.h"
#include "core/mesh/check.h"
#include "core/mesh/checked_mesh.h"
#include "core/mesh/loose_parts.h"
#include "core/mesh/plane.h"
#include "core/optimise/layers/split_result.h"
#include "core/optimise/memory.h"
#include "core/optimise/on_geometry/optimise_on_geometry.h"
#include "core/optimise/optimiser.h"
#include "core/quality/certified_quality.h"
#include "server/engine/engine.h"
#include "server/engine/geometry_messages.h"
#include "server/engine/layer_messages.h"
#include "server/engine/mesh_parts.h"
#include "server/engine/most_threads.h"
#include "server/engine/option_messages.h"
#include "server/engine/output_check.h"
#include "server/engine/translate.h"
#include "server/engine/write_outputs.h"

namespace varimesh::server {
namespace {

double pairs_of_nodes(const HighOrderMesh& mesh, const Options& options) {
  double pairs = 0;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension) continue;
    const double nodes = reference::node_count(block.shape, options.order > 0 ? options.order : block.order);
    pairs += static_cast<double>(block.size()) * nodes * nodes;
  }
  return pairs;
}

Expected<formats::MeshFile> read_mesh(std::string_view bytes, v1::MeshFormat format, int threads,
                                      const StopToken& stop) {
  if (format != v1::MESH_FORMAT_PARTS) return formats::read(bytes, threads, &stop);
  return read_mesh_parts(bytes, &stop).map([](HighOrderMesh&& mesh) {
    return formats::MeshFile{std::move(mesh), formats::Format::Auto};
  });
}

/// The options of a job that judges a mesh: nothing moves, and only the threads and the time limit are the job's.
Options judging_options(const Options& asked) {
  Options options;
  options.max_iterations = 0;
  options.threads = asked.threads;
  options.time_limit = asked.time_limit;
  return options;
}

/// An upper bound on the memory of the tables with which a quality job samples the cells: for each point of the
/// lattice, the derivatives of all shape functions.
std::int64_t memory_of_lattice(const HighOrderMesh& mesh, int intervals) {
  double most = 0;
  for (const ElementBlock& block : mesh.blocks) {
    const reference::ShapeInfo& shape = reference::info(block.shape);
    if (shape.dimension != mesh.dimension) continue;
    const double points = std::pow(intervals + 1.0, shape.dimension) / (shape.affine ? shape.dimension : 1);
    most = std::max(most, points * reference::node_count(block.shape, block.order) * 3 * sizeof(double));
  }
  return static_cast<std::int64_t>(std::min(most, 1e18));
}

/// Judges a mesh without moving anything, as the command's `quality` does.
Expected<Result> judge(CheckedMesh of, const v1::QualityTask& task, const Options& options, const RunHooks& hooks) {
  const HighOrderMesh& mesh = of.mesh;
  const auto sizes = summarise(of, options);
  if (!sizes) return tl::unexpected(sizes.error());
  Result result;
  result.sizes = *sizes;
  StopToken stop(
      [&] { return (hooks.control.stop_asked && hooks.control.stop_asked()) || (hooks.given_up && hooks.given_up()); });
  if (options.time_limit > 0) stop.stop_after(options.time_limit - of.seconds);
  Team team(options.threads);
  team.set_stop(&stop);
  try {
    result.before = result.after = quality(mesh, task.lattice(), team, of.facets.first.empty() ? nullptr : &of.facets);
    if (task.diagnose() && !result.after.uncertified.empty())
      result.unrepairable = with_any_of(diagnose(mesh, team), uncertified_numbers(result.after));
  } catch (const Interrupted&) {
    if (stop.reason() == StopToken::Reason::TimeLimit)
      return bad_input("The time limit passed while the mesh was judged; allow more time, or take a coarser lattice.");
    result.stopped = true;
  }
  result.mesh = std::move(of.mesh);
  return result;
}

/// Says that a mesh of order 1 stays straight when its order is raised.
void note_straight_boundary(const HighOrderMesh& mesh, const RunRequest& request, const RunHooks& hooks) {
  const int order = request.options.order;
  if (request.quality || mesh.order != 1 || order <= 1 || !hooks.on_note) return;
  const std::string raised = std::to_string(order);
  hooks.on_note(
      "The mesh has order 1. Raised to order " + raised +
      ", its boundary is still straight, because new nodes are put on the straight edges and faces. To curve it, " +
      (mesh.dimension == 3 ? "curve the mesh on its CAD model, " : "") +
      "let the mesh generator raise the order on the geometry (for example: gmsh GEOMETRY -3 -order " + raised +
      "), or move the boundary nodes of a mesh of order " + raised + " before it is optimised.");
}

/// Has the writers give elements that came at a lower order than others their own order again.
void keep_orders(HighOrderMesh& mesh, int order, const RunHooks& hooks) {
  const bool has_lower = formats::keep_orders(mesh), changes = order != 0 && order != mesh.order;
  if (!hooks.on_note || (has_lower && !changes)) return;
  hooks.on_note(has_lower ? "No element keeps its own order, because all get order " + std::to_string(order) +
                                ". Without an order for the result, elements keep their own orders."
                          : "No element came at a lower order than others, so there are no orders to keep.");
}

/// The summary of a run that was stopped before it had a mesh.
RunSummary stopped_early() {
  RunSummary summary;
  summary.stopped = true;
  return summary;
}

/// How long a mesh is still read after the run was asked to stop.
constexpr double kSecondsToReadOn = 0.25;
/// A time limit that has passed, in seconds; 0 would be none.
constexpr double kNoTimeLeft = 1e-9;

/// Reads the mesh of the request, with the memory for it, and takes the time from the request's time limit. Nothing if
/// the run is to stop.
Expected<std::optional<formats::MeshFile>> read_input(RunRequest& request, const RunHooks& hooks) {
  const std::string_view bytes = request.input->bytes();
  const auto size = static_cast<std::int64_t>(bytes.size());
  const int threads =
      std::min(request.options.threads, most_threads(static_cast<double>(bytes.size()), kBytesPerThread));
  const std::int64_t seldom = request.format == v1::MESH_FORMAT_PARTS ? 0 : formats::seldom_needed_to_read(bytes);
  std::int64_t claimed = formats::most_memory_to_read(size, threads) - seldom;
  bool admitted = true;
  const auto claim = [&](std::int64_t more) -> Expected<bool> {
    if (!hooks.admit_reading) return true;
    const auto answer = hooks.admit_reading(formats::least_memory(size), claimed += more);
    admitted = answer && *answer;
    return answer;
  };
  if (const auto first = claim(0); !first || !*first)
    return first ? Expected<std::optional<formats::MeshFile>>(std::nullopt) : tl::unexpected(first.error());
  WithheldMemory withheld(seldom, [&](std::int64_t more) { return claim(more).value_or(false); });
  const WithheldMemory::Scope scope(&withheld);
  double& limit = request.options.time_limit;
  // A run that is stopped hands out the mesh as it came, so a mesh that is nearly read is read to its end.
  std::atomic<bool> asked = false;
  StopToken grace;
  std::mutex first;
  StopToken stop([&] {
    if (hooks.given_up && hooks.given_up()) return true;
    if (!asked && !hooks.control.stop_asked()) return false;
    const std::scoped_lock lock(first);
    if (!asked.exchange(true)) grace.stop_after(kSecondsToReadOn);
    return grace.stopped();
  });
  if (limit > 0) stop.stop_after(limit);
  const Stopwatch watch;
  auto file = read_mesh(bytes, request.format, threads, stop);
  request.input.reset();
  if (stop.reason() == StopToken::Reason::Asked || !admitted) return std::nullopt;
  if (stop.reason() == StopToken::Reason::TimeLimit)
    return bad_input("The time limit passed while the mesh was read; allow more seconds, or none (0).");
  if (!file) return tl::unexpected(file.error());
  if (limit > 0) limit = std::max(kNoTimeLeft, limit - watch.seconds());
  return std::move(*file);
}

/// The options of the request's geometry; nothing if it has none.
Expected<std::optional<GeometryOptions>> geometry_of(const RunRequest& request) {
  if (!request.geometry) return std::optional<GeometryOptions>();
  auto options = options_from(*request.geometry);
  if (!options) return bad_option(options.error().sentence);
  if (!options->on_boundary() && request.model == nullptr) return takes_no_models();
  return std::optional(std::move(*options));
}

/// Runs the optimisation on a geometry. `metrics` gets what came of it, and what was tried.
/// @param model  null: the mesh's own boundary
Expected<Result> optimise_sliding(HighOrderMesh mesh, const GeometryOptions& geometry, const geometry::CadModel* model,
                                  const Options& options, const RunControl& control, const RunHooks& hooks,
                                  v1::Metrics& metrics) {
  OnGeometryHooks told;
  told.on_sentence = hooks.on_note;
  told.threads_to_slide = hooks.control.threads;  // all that the job has now
  if (hooks.on_slide_trial) told.on_trial = [&](const SlideTrial& trial) { hooks.on_slide_trial(to_proto(trial)); };
  Expected<geometry::Geometry> read;
  if (model != nullptr) read = model->geometry();
  if (!read) return tl::unexpected(read.error());
  auto done = optimise_on_geometry(std::move(mesh), options, geometry, model == nullptr ? nullptr : &*read,
                                   hooks.on_iteration, control, told);
  if (!done) return tl::unexpected(done.error());
  if (done->slid && model != nullptr) *metrics.mutable_geometry() = to_proto(*done->slid);
  for (const SlideTrial& trial : done->trials) *metrics.add_slide_trials() = to_proto(trial);
  return std::move(done->result);
}

/// The layers that the request asks for; nothing if it asks for none.
Expected<std::optional<LayerOptions>> layers_of(const RunRequest& request) {
  if (!request.layers) return std::optional<LayerOptions>();
  auto options = options_from(*request.layers);
  if (!options) return bad_option(options.error().sentence);
  return std::optional(std::move(*options));
}

/// The mesh with its CAD model, if normals of walls are to be found on it. Without a model, and if the mesh does not
/// fit, which the run says later, there is none. Throws Interrupted if the team's token says so.
std::optional<Association> associated(const CheckedMesh& of, const geometry::CadModel* model, const Team& team) {
  if (model == nullptr) return std::nullopt;
  const auto geometry = model->geometry();
  if (!geometry) return std::nullopt;
  Expected<Association> found;
  team.run([&] {
    found = of.plane                 ? associate_flattened(of.mesh, *of.plane, *geometry, team)
            : of.mesh.dimension == 2 ? associate_in_plane(of.mesh, *geometry, team)
                                     : associate(of.mesh, *geometry, team);
  });
  return found ? std::optional(std::move(*found)) : std::nullopt;
}

/// Grows thick cells on the walls, if that is wanted, and takes the time from the time limit. `metrics` gets what came
/// of it. If the run is stopped, or the time limit passes before a layer can be made in haste, the mesh stays as it
/// came. Returns how thick the cells are, or nothing if the mesh cannot have the layers that are wanted for this
/// reason.
Expected<std::optional<ThicknessShares>> grow_thick_cells(CheckedMesh& mesh, const std::optional<LayerOptions>& layers,
                                                          RunRequest& request, const RunHooks& hooks,
                                                          v1::Metrics& metrics) {
  if (!layers || layers->grow == 0) return std::optional<ThicknessShares>(std::in_place);
  Options& options = request.options;
  const std::function<bool()> asked = [&] {
    return (hooks.control.stop_asked && hooks.control.stop_asked()) || (hooks.given_up && hooks.given_up());
  };
  StopToken stop(asked);
  if (options.time_limit > 0) stop.stop_after(options.time_limit);
  const Stopwatch watch;
  Team team(options.threads);
  team.set_stop(&stop);
  Expected<GrownLayer> grown;
  try {
    const auto model = associated(mesh, request.model.get(), team);
    grown = grow_layer(mesh, layers->walls, layers->grow, team, model ? &*model : nullptr, asked);
  } catch (const Interrupted&) {
    const bool was_late = stop.reason() == StopToken::Reason::TimeLimit;
    if (was_late) options.time_limit = kNoTimeLeft;
    if (hooks.on_note)
      hooks.on_note(std::string(was_late ? "The time limit passed" : "The run was stopped") +
                    " while the layer was grown, so the mesh gets no layers. It is not optimised either.");
    return std::optional<ThicknessShares>();
  }
  if (!grown) return tl::unexpected(grown.error());
  team.set_stop(nullptr);
  if (hooks.on_note) hooks.on_note(grown->sentence);
  *metrics.mutable_layers() = to_proto(*grown);
  auto checked = check_mesh(std::move(grown->mesh), CheckFor::Optimising, team);
  if (!checked) return tl::unexpected(checked.error());
  mesh = std::move(*checked);
  if (options.time_limit > 0) options.time_limit = std::max(kNoTimeLeft, options.time_limit - watch.seconds());
  return std::optional(std::move(grown->shares));
}

/// Splits thick cells of the result into layers. `metrics` gets what came of it. Returns how thick the row is in each
/// cell, if it was grown for this run: see thickness_of_cells().
/// @param grown  how thick the cells are, if they were grown
Expected<std::vector<double>> make_layers(Result& result, const LayerOptions& layers, const ThicknessShares& grown,
                                          int threads, const RunHooks& hooks, v1::Metrics& metrics) {
  if (result.stopped) {
    if (hooks.on_note) hooks.on_note("The run was stopped, so the cells at the walls are not split into layers.");
    if (grown.empty()) return std::vector<double>();
    const auto checked = check_mesh(result.mesh, CheckFor::Judging, Team(threads));
    return checked ? thickness_of_cells(*checked, layers.walls, grown) : tl::unexpected(checked.error());
  }
  auto made = split_result(result, layers, grown, threads);
  if (!made) return tl::unexpected(made.error());
  metrics.mutable_layers()->MergeFrom(to_proto(made->report));
  *metrics.mutable_layers()->mutable_thick() = to_proto(made->thick);
  return std::move(made->thickness);
}

/// Says what does not hang together in a mesh that is to be optimised or judged.
void note_loose_parts(const CheckedMesh& of, int threads, const RunHooks& hooks) {
  if (!hooks.on_note || of.facets.first.empty()) return;
  std::vector<std::string> sentences;
  const Team team(threads);
  team.run([&] { sentences = loose_parts(of.mesh, of.facets, team); });
  for (const std::string& sentence : sentences) hooks.on_note(sentence);
}

/// Refuses a surface in space: its nodes slide without a job, and it is not curved. Errors: BadInput.
Expected<void> check_takes(const HighOrderMesh& mesh, const std::optional<GeometryOptions>& geometry) {
  if (!geometry || !is_surface(mesh) || lies_in_a_plane(mesh)) return {};
  if (geometry->order > 0)
    return bad_input("The mesh is a surface in space, which is not curved. Close the faces of the model to a body.");
  return bad_input("The mesh is a surface in space; its nodes slide without a server, by the command itself.");
}

/// The bytes that a run has in use at most. Errors: BadOption, BadInput if it cannot have its layers.
/// @param order  of the result; 0: that of the mesh
Expected<std::int64_t> memory_of_run(const CheckedMesh& checked, const RunRequest& request,
                                     const std::optional<GeometryOptions>& geometry,
                                     const std::optional<LayerOptions>& layers, int order) {
  const HighOrderMesh& mesh = checked.mesh;
  std::int64_t memory =
      geometry ? memory_needed_on_geometry(mesh, request.options, *geometry) : memory_needed(mesh, request.options);
  if (request.quality) memory += memory_of_lattice(mesh, request.quality->lattice());
  if (request.model) memory += request.model->memory();
  if (!layers) return memory;
  const auto more = memory_of_layers(checked, *layers, memory, order, Team(request.options.threads));
  return more ? memory + *more : more;
}

Expected<RunOutcome> run(RunRequest request, const RunHooks& hooks) {
  const auto geometry = geometry_of(request);
  if (!geometry) return tl::unexpected(geometry.error());
  const auto layers = layers_of(request);
  if (!layers) return tl::unexpected(layers.error());
  if (request.quality) request.options = judging_options(request.options);
  auto file = read_input(request, hooks);
  if (!file) return tl::unexpected(file.error());
  if (!*file) return RunOutcome(stopped_early());
  for (const std::string& note : formats::reading_notes((*file)->mesh))
    if (hooks.on_note) hooks.on_note(note);
  if (request.keep_orders) keep_orders((*file)->mesh, request.options.order, hooks);
  const v1::MeshFormat read_as =
      request.format == v1::MESH_FORMAT_PARTS ? v1::MESH_FORMAT_PARTS : to_proto((*file)->format);

  if (const auto takes = check_takes((*file)->mesh, *geometry); !takes) return tl::unexpected(takes.error());
  auto checked = check_mesh(std::move((*file)->mesh), request.quality ? CheckFor::Judging : CheckFor::Optimising,
                            Team(request.options.threads));
  if (!checked) return tl::unexpected(checked.error());
  HighOrderMesh& mesh = checked->mesh;
  note_loose_parts(*checked, request.options.threads, hooks);
  Options in_the_end = request.options;  // with the order of the result
  if (*geometry && (*geometry)->order > 0) in_the_end.order = (*geometry)->order;
  const auto outputs = definite_outputs(request.outputs, read_as);
  if (const auto have = check_outputs_can_hold(mesh, in_the_end.order, outputs, request.options.threads); !have)
    return tl::unexpected(have.error());
  const auto memory = memory_of_run(*checked, request, *geometry, *layers, in_the_end.order);
  if (!memory) return tl::unexpected(memory.error());
  const Expected<bool> admitted = hooks.admit ? hooks.admit(*memory) : Expected<bool>(true);
  if (!admitted) return tl::unexpected(admitted.error());
  if (!*admitted || (hooks.given_up && hooks.given_up())) return RunOutcome(stopped_early());
  v1::Metrics of_job;  // what the library's run knows nothing of
  const auto grown = grow_thick_cells(*checked, *layers, request, hooks, of_job);
  if (!grown) return tl::unexpected(grown.error());
  if (hooks.given_up && hooks.given_up()) return RunOutcome(stopped_early());
  note_straight_boundary(mesh, request, hooks);
  const int most = most_threads(pairs_of_nodes(mesh, in_the_end), kPairsPerThread);
  RunControl control = hooks.control;
  if (control.threads) control.threads = [&] { return std::min(hooks.control.threads(), most); };
  show_while_running(control, mesh, hooks);
  request.options.threads = std::min(request.options.threads, most);
  if (*geometry && checked->plane) checked->plane->put_back(mesh);  // the geometry is in space
  auto result = request.quality ? judge(std::move(*checked), *request.quality, request.options, hooks)
                : *geometry     ? optimise_sliding(std::move(checked->mesh), **geometry, request.model.get(),
                                                   request.options, control, hooks, of_job)
                                : optimise(std::move(*checked), request.options, hooks.on_iteration, control);
  if (!result) return tl::unexpected(result.error());
  Expected<std::vector<double>> thickness;
  if (*layers && *grown) thickness = make_layers(*result, **layers, **grown, request.options.threads, hooks, of_job);
  if (!thickness) return tl::unexpected(thickness.error());
  const bool wanted = !(result->stopped && hooks.given_up());
  const Expected<bool> written = wanted ? write_outputs(*result, *thickness, request, read_as, hooks) : true;
  if (!written) return tl::unexpected(written.error());
  RunOutcome outcome(static_cast<const RunSummary&>(*result));
  outcome.stopped = outcome.stopped || !*written;
  outcome.unwritten = !*written;
  outcome.metrics.MergeFrom(of_job);
  return outcome;
}

}  // namespace

Engine core_engine() {
  return {
      [](const Options& options) { return check(options); },
      [](RunRequest request, const RunHooks& hooks) -> Expected<RunOutcome> { return run(std::move(request), hooks); },
      [](const v1::Geometry& geometry, const Options& options) -> Expected<void> {
        return is_on_boundary(geometry) ? check(geometry, options) : takes_no_models();
      }};
}

}  // namespace varimesh::server
