// A run that several processes make together, with the library as the service uses it, but without the service.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/base/io/sink.h"
#include "core/optimise/run_control.h"
#include "core/ranks/ranks.h"
#include "varimesh/v1/job.pb.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

struct SharedRun {
  std::string mesh;  ///< The bytes of the file, the same on all ranks.
  v1::Options options;
  std::vector<v1::MeshFormat> outputs;  ///< Each once; UNSPECIFIED: the format of the input.
  bool keep_orders = false;             ///< Elements that came at a lower order are written so again.
  /// Returns where the result in the next format goes. Only the first rank writes.
  std::function<Sink()> open_output;
  std::function<void(const std::string&)> on_note;  ///< Gets sentences about the run; may be empty.
  /// Called when all ranks have read the mesh, and the run begins. May be empty.
  std::function<void()> on_begin;
  /// From then on: whether this rank is asked to end the run. All ranks end it soon, with the best mesh so far. Several
  /// threads call it, at any time. May be empty.
  std::function<bool()> stop_asked;
  /// What a run has saved from which this one goes on, the same on all ranks; it must outlive the run. Empty: none. One
  /// of another run is ignored, with a note.
  std::string_view checkpoint;
  /// Called on the first rank after an iteration: whether to save a checkpoint, and to save it. All ranks have both, or
  /// none does.
  std::function<bool()> checkpoint_due;
  std::function<void(const WriteCheckpoint&)> save_checkpoint;
};

/// How it ended.
struct SharedOutcome {
  v1::Metrics metrics;
  v1::History history;
  bool stopped = false;  ///< A rank was asked to end the run.
};

/// All ranks call it with the same run, and none may leave before. Errors: BadInput, BadOption, Output. If one rank
/// fails, all get its error; if several fail, that of the first of them.
Expected<SharedOutcome> run_shared(SharedRun run, const Ranks& ranks);

}  // namespace varimesh::client
