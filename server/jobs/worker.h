// One attempt at a job: from the mesh in the store to the results in the store.
#pragma once

#include <functional>

#include "server/jobs/engine.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_store.h"
#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// What an attempt works with.
struct Attempt {
  const Claim& claim;
  const Engine& engine;
  MeshStore& meshes;
  EventLog& log;
  int threads = 1;  ///< What the budget gives at most.
  std::function<TimePoint()> clock;
  std::function<bool()> cancelled;
  std::function<void(const v1::Iteration&)> note_progress;  ///< Called at most twice a second.
};

/// Runs the attempt to its end, reporting iterations and quality to the log. Never throws: whatever goes wrong is in
/// the ending. Results of an attempt that does not succeed are released.
Ending run_attempt(const Attempt& attempt);

}  // namespace varimesh::server
