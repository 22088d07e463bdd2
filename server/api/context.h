// What all handlers share, and how a unary call is moved to the pool.
#pragma once

#include <grpcpp/grpcpp.h>

#include <utility>

#include "server/limits.h"
#include "server/meshes/mesh_store.h"
#include "server/resources/pool.h"
#include "server/scheduling/scheduler.h"
#include "server/streams/calls.h"
#include "server/streams/peer_counts.h"
#include "server/streams/status.h"

namespace varimesh::server {

/// The parts of a running server that the handlers use. All of them outlive every call.
struct ApiContext {
  Scheduler& scheduler;
  MeshStore& meshes;
  Pool& pool;
  CallRegistry& calls;
  PeerCounts& watches;
  PeerCounts& uploads;
  const Limits& limits;
  TimePoint start_time;
};

/// Answers a unary call with the status of `work`, which runs on the pool because it may wait for a disk or a database.
template <class Work>
grpc::ServerUnaryReactor* unary(grpc::CallbackServerContext* call, Pool& pool, Work work) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  pool.post([reactor, work = std::move(work)] { reactor->Finish(guarded(work)); });
  return reactor;
}

}  // namespace varimesh::server
