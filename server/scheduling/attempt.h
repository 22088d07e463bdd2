// One attempt at a job, from the mesh in the store to the results in the store.
#pragma once

#include <functional>

#include "server/engine/engine.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_store.h"
#include "server/meshes/mesh_store.h"
#include "server/resources/device_budget.h"
#include "server/resources/memory_budget.h"
#include "server/resources/thread_shares.h"

namespace varimesh::server {

/// Everything that an attempt uses.
struct Attempt {
  const Claim& claim;
  const Engine& engine;
  MeshStore& meshes;
  EventLog& log;
  const LentThreads& threads;
  MemoryBudget& memory;
  std::function<TimePoint()> clock;    ///< For the times of the events.
  std::function<SteadyTime()> steady;  ///< For intervals; nobody sets it back.
  std::function<bool()> cancelled;     ///< Whether the job was cancelled.
  std::function<bool()> stopping;      ///< Whether the server stops and the job is to be continued later.
  std::function<void(const v1::Iteration&)> note_progress;  ///< Called at most twice per second.
  /// Shortest time between two checkpoints, except when the server stops.
  std::chrono::milliseconds checkpoint_pause{5'000};
  /// Records a checkpoint that is in the mesh store, and takes over its reference. Returns false if it cannot be
  /// recorded; then the next attempt begins at an earlier one. Null: no checkpoints are saved.
  std::function<bool(const CheckpointReference&)> note_checkpoint;
  /// How long a run may go on when the server stops, to reach an iteration that can be saved as a checkpoint.
  std::function<std::chrono::milliseconds()> stop_patience = [] { return std::chrono::milliseconds(10'000); };
  /// Time between two tries to store something on a full disk.
  std::chrono::milliseconds store_pause{500};
  std::function<void()> waits_for_room = [] {};  ///< Called before the first of them.
  /// Called when a stage begins: "fetch" (of the mesh), "read", the phases of the optimisation, "store" (of the
  /// result). May be called again in the same stage. `since`: when the stage before has ended.
  std::function<void(const std::string& stage, TimePoint since)> on_stage = [](const auto&, TimePoint) {};
  /// Called after iterations and at the end, with what the kernels have done since the call before.
  std::function<void(const KernelWork&)> kernels_worked = [](const KernelWork&) {};
  DeviceBudget* devices = nullptr;  ///< Null: there are none.
};

/// Runs the attempt to its end and adds its iterations to the event log. Never throws: all failures are returned in the
/// ending. The state is PENDING if the run ended because the server stops. If the disk is full, the attempt waits for
/// room; if the job is cancelled meanwhile, it is CANCELLED without a result. If the ending has no results, everything
/// that was stored has been released.
Ending run_attempt(const Attempt& attempt);

}  // namespace varimesh::server
