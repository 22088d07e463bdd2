// From the bytes of a file to those of the results, by the numerical library.
#include <utility>

#include "core/optimise/memory.h"
#include "core/marks/marks.h"
#include "server/jobs/engine.h"
#include "server/jobs/translate.h"
#include "server/meshes/parts.h"

namespace varimesh::server {
namespace {

Expected<formats::MeshFile> read_mesh(std::string_view bytes, v1::MeshFormat format) {
  if (format != v1::MESH_FORMAT_PARTS) return formats::read(bytes);
  return read_parts(bytes).map([](HighOrderMesh&& mesh) {
    return formats::MeshFile{std::move(mesh), formats::Format::Auto};
  });
}

/// The formats to write: those asked for, with "as it was read" made definite.
std::vector<v1::MeshFormat> definite_outputs(std::vector<v1::MeshFormat> outputs, v1::MeshFormat read_as) {
  if (outputs.empty()) outputs.push_back(v1::MESH_FORMAT_UNSPECIFIED);
  for (v1::MeshFormat& output : outputs)
    if (output == v1::MESH_FORMAT_UNSPECIFIED) output = read_as;
  return outputs;
}

Expected<void> write_mesh(const Result& result, v1::MeshFormat format, int threads, const formats::Sink& sink) {
  if (format == v1::MESH_FORMAT_PARTS) return write_parts(result.mesh, sink);
  if (format == v1::MESH_FORMAT_VTU) {
    const CellMarks marks(result.mesh, result.unrepairable, threads);
    return formats::write(result.mesh, format_from(format), sink, marks.fields());
  }
  // MSH 2.2 repeats an element for each further group, and readers who do not know that count it twice.
  const bool repeats = format == v1::MESH_FORMAT_MSH22 || format == v1::MESH_FORMAT_MSH22_BINARY;
  if (result.unrepairable.empty() || repeats) return formats::write(result.mesh, format_from(format), sink);
  HighOrderMesh marked = result.mesh;
  mark_unrepairable(marked, result.unrepairable);
  return formats::write(marked, format_from(format), sink);
}

Expected<RunOutcome> run(RunRequest request, const RunHooks& hooks) {
  auto file = read_mesh(request.input->bytes(), request.format);
  request.input.reset();
  if (!file) return tl::unexpected(file.error());
  const v1::MeshFormat read_as =
      request.format == v1::MESH_FORMAT_PARTS ? v1::MESH_FORMAT_PARTS : to_proto(file->format);

  RunOutcome outcome;
  if (hooks.admit)
    if (const auto admitted = hooks.admit(memory_needed(file->mesh, request.options)); !admitted)
      return tl::unexpected(admitted.error());
  if (hooks.cancelled()) {
    outcome.stopped = true;
    return outcome;
  }
  RunControl control;
  control.checkpoint_due = [&](const Iteration& iteration) {
    return hooks.checkpoint_due && hooks.checkpoint_due(iteration.number);
  };
  control.save_checkpoint = [&](const Iteration& iteration, const WriteCheckpoint& write) {
    hooks.save_checkpoint(iteration.number, write);
  };
  control.threads = hooks.threads;
  control.stop_asked = hooks.cancelled;
  if (request.checkpoint) control.checkpoint = request.checkpoint->bytes();
  auto result = optimise(std::move(file->mesh), request.options, hooks.on_iteration, control);
  if (!result) return tl::unexpected(result.error());
  outcome = {result->sizes,      result->iterations,         result->seconds,
             result->residual,     result->converged,          result->stopped,
             result->stop_reason,  std::move(result->before),  std::move(result->after),
             result->unrepairable, std::move(result->repairs), std::move(result->history)};
  if (result->stopped && hooks.given_up()) return outcome;
  for (const v1::MeshFormat format : definite_outputs(request.outputs, read_as))
    if (const auto written = write_mesh(*result, format, request.options.threads, hooks.open_output(format)); !written)
      return tl::unexpected(written.error());
  return outcome;
}

}  // namespace

Engine core_engine() {
  return {[](const Options& options) { return check(options); },
          [](RunRequest request, const RunHooks& hooks) { return run(std::move(request), hooks); }};
}

}  // namespace varimesh::server
