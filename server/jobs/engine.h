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
};

/// What the run tells, and where it writes.
struct RunHooks {
  OnIteration on_iteration;
  std::function<bool()> cancelled;  ///< Asked between the steps.
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
  std::vector<Iteration> history;
};

struct Engine {
  std::function<Expected<void>(const Options&)> check_options;
  std::function<Expected<RunOutcome>(RunRequest, const RunHooks&)> run;
};

/// The real one: formats::read, check, optimise, formats::write.
Engine core_engine();

}  // namespace varimesh::server
