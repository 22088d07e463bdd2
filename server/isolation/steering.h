// What the process of a job is to look at all the time.
#pragma once

#include "server/engine/engine.h"
#include "server/isolation/worker.pb.h"

namespace varimesh::server {

/// @param threads  how many the run may use if the hooks do not say
/// @param full  the store takes no more of the output
inline worker::Steering steering_by(const RunHooks& hooks, int threads, bool full) {
  worker::Steering steering;
  steering.set_threads(hooks.control.threads ? hooks.control.threads() : threads);
  steering.set_stop(hooks.control.stop_asked());
  steering.set_given_up(hooks.given_up && hooks.given_up());
  steering.set_full(full);
  steering.set_watched(hooks.mesh_watched && hooks.mesh_watched());
  return steering;
}

}  // namespace varimesh::server
