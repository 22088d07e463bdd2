// From the bytes of a file to those of the results, by the numerical library.
#include <array>
#include <utility>

#include "core/quality/quality.h"
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

Expected<void> write_mesh(const HighOrderMesh& mesh, v1::MeshFormat format, int threads, const formats::Sink& sink) {
  if (format == v1::MESH_FORMAT_PARTS) return write_parts(mesh, sink);
  if (format != v1::MESH_FORMAT_VTU) return formats::write(mesh, format_from(format), sink);
  // What a viewer wants to colour the cells by.
  const CellQuality cells = cell_quality(mesh, 0, threads);
  const std::array<formats::CellField, 2> fields{
      {{"scaled_jacobian", cells.scaled_jacobian}, {"distortion_jacobian", cells.distortion_jacobian}}};
  return formats::write(mesh, format_from(format), sink, fields);
}

Expected<RunOutcome> run(RunRequest request, const RunHooks& hooks) {
  auto file = read_mesh(request.input->bytes(), request.format);
  request.input.reset();
  if (!file) return tl::unexpected(file.error());
  const v1::MeshFormat read_as =
      request.format == v1::MESH_FORMAT_PARTS ? v1::MESH_FORMAT_PARTS : to_proto(file->format);

  RunOutcome outcome;
  if (hooks.cancelled()) {
    outcome.stopped = true;
    return outcome;
  }
  auto result = optimise(std::move(file->mesh), request.options, hooks.on_iteration);
  if (!result) return tl::unexpected(result.error());
  outcome = {result->summary,           result->iterations,       result->seconds,
             result->residual,          result->converged,        result->stopped || hooks.cancelled(),
             std::move(result->before), std::move(result->after), std::move(result->history)};
  if (outcome.stopped) return outcome;
  for (const v1::MeshFormat format : definite_outputs(request.outputs, read_as))
    if (const auto written = write_mesh(result->mesh, format, request.options.threads, hooks.open_output(format));
        !written)
      return tl::unexpected(written.error());
  return outcome;
}

}  // namespace

Engine core_engine() {
  return {[](const Options& options) { return check(options); },
          [](RunRequest request, const RunHooks& hooks) { return run(std::move(request), hooks); }};
}

}  // namespace varimesh::server
