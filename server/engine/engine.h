// The numerical library as the service uses it: two functions, so that tests of the service can replace it.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/device/fault.h"
#include "core/formats/formats.h"
#include "core/optimise/iteration.h"
#include "core/optimise/result.h"
#include "core/optimise/run_control.h"
#include "core/options/options.h"
#include "server/meshes/mesh_store.h"
#include "varimesh/v1/job.pb.h"
#include "varimesh/v1/mesh.pb.h"

namespace varimesh::geometry {
class CadModel;
}  // namespace varimesh::geometry

namespace varimesh::server {

/// The input of a run.
struct RunRequest {
  std::shared_ptr<const Blob> input;  ///< The bytes of the mesh. Released as soon as the mesh is read.
  v1::MeshFormat format = v1::MESH_FORMAT_UNSPECIFIED;
  Options options;                         ///< `threads` is what the thread budget gives, never 0.
  std::vector<v1::MeshFormat> outputs;     ///< The formats of the results. Empty: the format of the input.
  std::optional<v1::QualityTask> quality;  ///< If set, the mesh is judged, and nothing moves.
  std::optional<v1::Geometry> geometry;    ///< If set, boundary nodes slide before the mesh is optimised.
  std::optional<v1::Layers> layers;        ///< If set, thick cells are split into layers after the optimisation.
  bool keep_orders = false;                ///< Each element is written at the order at which it came.
  std::shared_ptr<const Blob> cad_file;    ///< The CAD file if nodes slide on a model. core_engine() does not read it.
  std::shared_ptr<const geometry::CadModel> model;  ///< The model once it is read. core_engine() slides on it.
  std::string device;         ///< The device that the run may have, as CUDA_VISIBLE_DEVICES names it. Empty: none.
  std::string why_no_device;  ///< Why it has no device although the server has devices: a sentence for the result.
};

/// How a run ended.
struct RunOutcome {
  RunOutcome() = default;
  /// What the library says about a run. It leaves out the metrics that repeat the options (add_options()).
  RunOutcome(const RunSummary& summary);  // NOLINT(google-explicit-constructor): engines return what the library does

  bool stopped = false;  ///< Ended by the caller.
  /// Stopped before all of its outputs were written, so none of them counts.
  bool unwritten = false;
  v1::Metrics metrics;
  v1::History history;
  /// Why the run has no outcome, as a part of a sentence: its process ended before it did. Empty: it has one.
  std::string lost;
};

/// Jobs have no graphics card, unless the caller opens one or the process of a job has one (server/isolation).
inline RunControl without_a_card() {
  RunControl control;
  control.open_device = [] {
    return device::fault(device::Fault::Kind::NoDriver, "This server gives its jobs no device.");
  };
  return control;
}

/// What a run calls, from the thread that runs it.
struct RunHooks {
  OnIteration on_iteration;
  /// Called with the work inside iterations by runs that do not use control.meter. May be empty.
  std::function<void(const v1::Work&)> on_work;
  /// Called with a sentence about the run that people should see. May be empty.
  std::function<void(const std::string&)> on_note;
  /// Called when another way to slide begins, and once more when it has ended. May be empty.
  std::function<void(const v1::SlideTrial&)> on_slide_trial;
  /// Whether somebody watches the mesh move. Empty: nobody ever does.
  std::function<bool()> mesh_watched;
  /// Takes the mesh as an iteration has left it, if somebody watches: the bytes of MESH_FORMAT_PARTS and behind them
  /// those of MESH_FORMAT_CELL_QUALITY.
  std::function<void(std::string bytes)> show_mesh;
  /// Checkpoints, threads, and whether the run is to stop, as the library asks for them. `control.checkpoint` is what
  /// an earlier attempt at the job has saved. If it can be used, the run continues from there, to the same bytes as
  /// without the interruption; otherwise, and if it is empty, the run starts from the beginning. `control.stop_asked`
  /// must be set. Every run adds what its kernels do to `control.meter`.
  RunControl control = without_a_card();
  /// Called before the mesh is read, and up to twice meanwhile, with the least and the most memory, in bytes, that
  /// reading takes. Waits until there is enough. False if the run is to stop. Errors: BadInput if the least memory can
  /// never be free.
  std::function<Expected<bool>(std::int64_t least, std::int64_t most)> admit_reading;
  /// Called once the mesh is read, with the memory that the run needs, in bytes, the mesh included. Waits until there
  /// is enough or the run is to stop. False if it is to stop and there is not enough. Errors: BadInput if there can
  /// never be enough.
  std::function<Expected<bool>(std::int64_t bytes)> admit;
  /// Whether a stopped run will be continued by another server, so that nobody needs its outputs.
  std::function<bool()> given_up;
  /// Called if the run will not use RunRequest::device. May be empty.
  std::function<void()> device_unused;
  /// Returns the sink for the next output. The format is never UNSPECIFIED.
  std::function<Sink(v1::MeshFormat)> open_output;
};

/// Runs jobs.
struct Engine {
  /// Checks options without a mesh. Errors: BadOption.
  std::function<Expected<void>(const Options&)> check_options;
  /// Reads the mesh, optimises it and writes the outputs. If the run is stopped, the outputs have the best mesh so far,
  /// which may be the mesh as it came. A run has none if it was not admitted, or was stopped while it read the
  /// mesh or while no byte of an output came for some seconds. Errors: BadInput, BadOption, Output.
  std::function<Expected<RunOutcome>(RunRequest, const RunHooks&)> run;
  /// Checks whether a job with these options can have a geometry here. Empty: it can have none. Errors: BadOption.
  std::function<Expected<void>(const v1::Geometry&, const Options&)> check_geometry = {};
  /// Whether a run with these options can use a device, if the mesh is large enough. Empty: it can.
  std::function<bool(const Options&)> uses_device = {};
};

/// The engine that uses the numerical library. It takes no CAD models, because it has no process to read them in: they
/// can make the program that reads them crash.
Engine core_engine();

}  // namespace varimesh::server
