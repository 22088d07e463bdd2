#include "server/engine/write_outputs.h"

#include <algorithm>
#include <atomic>
#include <memory>
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
  if (format == v1::MESH_FORMAT_CELL_QUALITY) {
    const CellMarks marks(result.mesh, {}, threads);
    const auto answer_of = [&](std::size_t cell) {
      const double certified = marks.certified()[cell];
      return certified > 0   ? v1::CELL_ANSWER_VALID
             : certified < 0 ? v1::CELL_ANSWER_INVALID
                             : v1::CELL_ANSWER_UNDECIDED;
    };
    return write_cell_quality(result.mesh, marks.scaled_jacobian(), answer_of, sink);
  }
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

/// The nodes of the largest mesh that is shown while its run goes on, and the most bytes of what is shown.
constexpr std::size_t kMostShownNodes = 100'000, kMostShownBytes = std::size_t{7} << 20;

/// The mesh as its parts and the quality of its cells; empty if it has too many bytes.
std::string bytes_of(const MeshOnTheWay& shown) {
  std::string bytes;
  const Sink sink = [&](std::string_view more) {
    bytes += more;
    return bytes.size() <= kMostShownBytes;
  };
  const auto answer_of = [&](std::size_t cell) {
    switch (shown.certificates[cell].answer) {
      case Certificate::Answer::Valid:
        return v1::CELL_ANSWER_VALID;
      case Certificate::Answer::Invalid:
        return v1::CELL_ANSWER_INVALID;
      case Certificate::Answer::Undecided:
        break;
    }
    return v1::CELL_ANSWER_UNDECIDED;
  };
  const bool is_whole =
      write_mesh_parts(shown.mesh, sink) && write_cell_quality(shown.mesh, shown.scaled_jacobians, answer_of, sink);
  return is_whole ? bytes : "";
}

}  // namespace

void show_while_running(RunControl& control, const HighOrderMesh& mesh, const RunHooks& hooks) {
  if (!hooks.mesh_watched || !hooks.show_mesh || mesh.node_count() > kMostShownNodes) return;
  static constexpr double kLeastPause = 0.5, kPausesOfCost = 19;
  struct Clock {
    Stopwatch watch;
    double began = 0, next = 0;  ///< In seconds.
  };
  const auto clock = std::make_shared<Clock>();
  control.mesh_wanted = [&hooks, clock] {
    clock->began = clock->watch.seconds();
    return clock->began >= clock->next && hooks.mesh_watched();
  };
  control.show_mesh = [&hooks, clock](const MeshOnTheWay& shown) {
    if (std::string bytes = bytes_of(shown); !bytes.empty()) hooks.show_mesh(std::move(bytes));
    const double now = clock->watch.seconds();
    clock->next = now + std::max(kLeastPause, kPausesOfCost * (now - clock->began));
  };
}

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
