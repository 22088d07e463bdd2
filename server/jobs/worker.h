// One attempt at a job: from the mesh in the store to the results in the store.
#pragma once

#include <functional>

#include "server/jobs/engine.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_store.h"
#include "server/jobs/memory_budget.h"
#include "server/jobs/thread_shares.h"
#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// What an attempt works with.
struct Attempt {
  const Claim& claim;
  const Engine& engine;
  MeshStore& meshes;
  EventLog& log;
  const LentThreads& threads;
  MemoryBudget& memory;
  std::function<TimePoint()> clock;
  std::function<bool()> cancelled;                          ///< Somebody asked for the job to end.
  std::function<bool()> stopping;                           ///< The server ends, and the job shall go on later.
  std::function<void(const v1::Iteration&)> note_progress;  ///< Called at most twice a second.
  /// Checkpoints are no closer to each other than this, but where the server stops.
  std::chrono::milliseconds checkpoint_pause{5'000};
  /// Keeps a checkpoint that is in the mesh store, and takes its reference over. Null: none are kept.
  std::function<void(const CheckpointReference&)> note_checkpoint;
};

/// Runs the attempt to its end, reporting iterations to the log. Never throws: whatever goes wrong is in the ending,
/// whose state is PENDING where the run was given up because the server stops. Results of an attempt that has none are
/// released.
Ending run_attempt(const Attempt& attempt);

}  // namespace varimesh::server
