// What every handler works with, and how a unary one leaves the reaction's thread.
#pragma once

#include <grpcpp/grpcpp.h>

#include <utility>

#include "server/api/calls.h"
#include "server/api/status.h"
#include "server/jobs/pool.h"
#include "server/jobs/scheduler.h"
#include "server/meshes/mesh_store.h"
#include "server/operations/limits.h"
#include "server/operations/peers.h"

namespace varimesh::server {

/// The parts of a running server, as the handlers see them. All outlive every call.
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

/// A unary call whose work is done on the pool, because it may wait for a disk or a database.
template <class Work>
grpc::ServerUnaryReactor* unary(grpc::CallbackServerContext* call, Pool& pool, Work work) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  pool.post([reactor, work = std::move(work)] { reactor->Finish(guarded(work)); });
  return reactor;
}

}  // namespace varimesh::server
