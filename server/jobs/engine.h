// What a worker runs: the numerical library, behind two functions so that tests of the service can do without it.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "core/formats/formats.h"
#include "core/optimise/optimiser.h"
#include "server/meshes/mesh_store.h"
#include "varimesh/v1/mesh.pb.h"

namespace varimesh::server {

/// One run, as a worker asks for it.
struct RunRequest {
  std::shared_ptr<const Blob> input;  ///< Let go as soon as the mesh is read.
  v1::MeshFormat format = v1::MESH_FORMAT_UNSPECIFIED;
  Options options;                      ///< `threads` is what the budget gives, never 0.
  std::vector<v1::MeshFormat> outputs;  ///< Empty: the format that is read.
  /// What an attempt before this one gave to save_checkpoint(): go on from there, to the same bytes as without the
  /// interruption. Null, or not to be read any more: from the start.
  std::shared_ptr<const Blob> checkpoint;
};

/// What the run tells, and where it writes.
struct RunHooks {
  OnIteration on_iteration;
  std::function<bool()> cancelled;  ///< Asked between the steps.
  /// How many threads there are for the next iteration; may be empty.
  std::function<int()> threads;
  /// Told, once the mesh is read, how many bytes the run will take: waits until they are there, or until it is
  /// cancelled. Errors: BadInput where they can never be.
  std::function<Expected<void>(std::int64_t bytes)> admit;
  /// Whether the run ends only to be gone on with elsewhere: its outputs are wanted by nobody.
  std::function<bool()> given_up;
  /// Asked, before on_iteration, after iterations whose state can be kept. Where it says yes, the engine saves it.
  std::function<bool(int iteration)> checkpoint_due;
  std::function<void(int iteration, const WriteCheckpoint& write)> save_checkpoint;
  /// Where the next output goes; the format is never UNSPECIFIED.
  std::function<formats::Sink(v1::MeshFormat)> open_output;
};

/// What came of it; the mesh itself went to the outputs.
struct RunOutcome {
  MeshSummary summary;
  int iterations = 0;
  double seconds = 0;
  double residual = 0;
  bool converged = false;
  bool stopped = false;  ///< Ended before its time, because it was asked to; written is the best mesh so far.
  StopReason stop_reason = StopReason::Iterations;
  QualityReport before;
  QualityReport after;
  std::vector<UnrepairableGroup> unrepairable;
  std::vector<RepairStep> repairs;
  std::vector<Iteration> history;
};

struct Engine {
  std::function<Expected<void>(const Options&)> check_options;
  std::function<Expected<RunOutcome>(RunRequest, const RunHooks&)> run;
};

/// The real one: formats::read, check, optimise, formats::write.
Engine core_engine();

}  // namespace varimesh::server
