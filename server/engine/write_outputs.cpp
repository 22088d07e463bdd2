#include "server/engine/write_outputs.h"

#include <atomic>
#include <string>
#include <utility>

#include "core/base/stop_token.h"
#include "core/base/stopwatch.h"
#include "core/formats/stoppable_write.h"
#include "core/layers/thickness_shares.h"
#include "core/optimise/marks/marks.h"
#include "server/engine/mesh_parts.h"
#include "server/engine/translate.h"

namespace varimesh::server {
namespace {

/// How long results must get on with being written. Those of a run that was cancelled are the best mesh so far, so they
/// are still wanted, unless no byte comes for some seconds, as when HDF5 makes thousands of small groups first. No byte
/// may take longer than the time limit of the run either.
class Writing {
 public:
  /// @param limit  in seconds; 0: none
  Writing(const RunHooks& hooks, double limit) : hooks_(hooks), limit_(limit), stop_([this] { return is_over(); }) {}

  /// The token for work that begins now. Work before it, which no token stops, is no silence.
  const StopToken& stop_from_now() {
    last_ = clock_.seconds();
    return stop_;
  }
  bool is_stopped() const { return stop_.reason() != StopToken::Reason::None; }
  bool is_out_of_time() const { return out_of_time_; }
  /// A sink that notes when bytes come. While it waits, for room on a full disk for example, they are not silent.
  Sink noted(Sink sink) {
    last_ = clock_.seconds();
    return [this, sink = std::move(sink)](std::string_view bytes) {
      takes_ = true;
      const bool goes_on = !stop_.stopped() && sink(bytes);
      last_ = clock_.seconds();
      takes_ = false;
      return goes_on;
    };
  }

 private:
  bool is_over() {
    // A run that has ended is not made again if its results can be written before its server is gone.
    constexpr double kSilence = 10, kSilenceIfGivenUp = 1;
    const double silence = clock_.seconds() - last_;
    if (takes_ || silence < kSilenceIfGivenUp) return false;
    if (hooks_.given_up && hooks_.given_up()) return true;
    if (silence < kSilence) return false;
    if (limit_ > 0 && silence > limit_) out_of_time_ = true;
    return out_of_time_ || (hooks_.control.stop_asked && hooks_.control.stop_asked());
  }

  const RunHooks& hooks_;
  const double limit_;
  const Stopwatch clock_;
  std::atomic<double> last_ = 0;
  std::atomic<bool> takes_ = false, out_of_time_ = false;
  const StopToken stop_;
};

Expected<void> write_mesh(const Result& result, std::span<const double> thickness, v1::MeshFormat format, int threads,
                          const Sink& sink, Writing& writing) {
  if (format == v1::MESH_FORMAT_PARTS) return write_mesh_parts(result.mesh, sink);
  if (format == v1::MESH_FORMAT_CELL_QUALITY)
    return write_cell_quality(result.mesh, CellMarks(result.mesh, {}, threads), sink);
  if (format == v1::MESH_FORMAT_VTU) {
    const CellMarks marks(result.mesh, result.unrepairable, threads, thickness);
    return formats::write(result.mesh, format_from(format), sink, marks.fields(), threads, &writing.stop_from_now());
  }
  // MSH 2.2 repeats an element for each additional group. Some readers do not know that and would count it twice.
  const bool repeats = format == v1::MESH_FORMAT_MSH22 || format == v1::MESH_FORMAT_MSH22_BINARY;
  const auto write = [&](const HighOrderMesh& mesh, std::span<const double> of_cells) {
    std::vector<formats::CellField> fields;
    if (!of_cells.empty()) fields.push_back(thickness_field(of_cells));
    return formats::write(mesh, format_from(format), sink, fields, threads, &writing.stop_from_now());
  };
  if (result.unrepairable.empty() || repeats) return write(result.mesh, thickness);
  HighOrderMesh marked = result.mesh;
  const std::vector<std::int32_t> cells = mark_unrepairable(marked, result.unrepairable);
  return write(marked, thickness_of_parts(thickness, cells));
}

}  // namespace

std::vector<v1::MeshFormat> definite_outputs(std::vector<v1::MeshFormat> outputs, v1::MeshFormat read_as) {
  if (outputs.empty()) outputs.push_back(v1::MESH_FORMAT_UNSPECIFIED);
  for (v1::MeshFormat& output : outputs)
    if (output == v1::MESH_FORMAT_UNSPECIFIED) output = is_writable(read_as) ? read_as : v1::MESH_FORMAT_MSH41_BINARY;
  return outputs;
}

Expected<bool> write_outputs(const Result& result, std::span<const double> thickness, const RunRequest& request,
                             v1::MeshFormat read_as, const RunHooks& hooks) {
  Writing writing(hooks, request.options.time_limit);
  for (const v1::MeshFormat format : definite_outputs(request.outputs, read_as)) {
    const Sink sink = writing.noted(hooks.open_output(format));
    const auto written = write_mesh(result, thickness, format, request.options.threads, sink, writing);
    if (!written && writing.is_out_of_time())
      return bad_input("Nothing of the result was written within the time limit; allow more seconds, or none (0).");
    if (!written && writing.is_stopped()) return false;
    if (!written) return tl::unexpected(written.error());
    const std::string lost = hooks.on_note ? formats::left_out(result.mesh, format_from(format)) : "";
    if (!lost.empty()) hooks.on_note(lost);
  }
  return true;
}

}  // namespace varimesh::server
