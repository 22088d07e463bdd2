// The gRPC server: all services, the address that it listens on, and the calls that are open.
#pragma once

#include <grpcpp/channel.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "server/api/context.h"
#include "server/api/health.h"
#include "server/api/job_service.h"
#include "server/api/mesh_service.h"
#include "server/api/optimise_service.h"
#include "server/metrics/metrics.h"
#include "server/sockets/socket_lock.h"
#include "server/sockets/tcp_listener.h"

namespace varimesh::server {

/// Lets a connection that waits keep little memory. To be called before gRPC is used, while the process has one thread.
void keep_connections_small();

/// Answers calls from listen() until stop().
class Endpoint {
 public:
  /// All but `start_time`, which GetServerInfo answers, must outlive this object. `metrics`: counts the calls; may be
  /// null.
  Endpoint(Scheduler& scheduler, MeshStore& meshes, const Access& access, const Limits& limits, const PageTokens& pages,
           TimePoint start_time, Metrics* metrics = nullptr);

  /// Listens on HOST:PORT or unix:PATH with these credentials; an empty address means in-process channels only. Call it
  /// once. Errors: Output if the address is already in use or does not belong to this machine. A socket whose server
  /// has ended is replaced.
  Expected<void> listen(const std::string& address, const std::shared_ptr<grpc::ServerCredentials>& credentials);

  /// The address with the port that was chosen; empty if there is none.
  const std::string& address() const { return address_; }
  int port() const { return port_; }
  /// Whether the server has just refused its own call to itself, because it has too many connections. That it does not
  /// reach itself is then no sign that it hangs.
  bool is_full() const;
  std::shared_ptr<grpc::Channel> in_process_channel();

  HealthService& health() { return health_; }
  /// Lets the open streams cancel stalled clients and send bookmarks; call it a few times per second.
  void tick() { calls_.tick(std::chrono::steady_clock::now()); }

  /// Answers NOT_SERVING, ends all streams with UNAVAILABLE, calls `between`, and shuts down. Streams have until
  /// `deadline`, and at most 5 s, to end.
  void stop(std::chrono::steady_clock::time_point deadline, const std::function<void()>& between);

 private:
  // In the order in which they use each other.
  CallRegistry calls_;
  PeerCounts watches_, uploads_, downloads_;
  Pool pool_, files_, large_;
  const ApiContext context_;
  HealthService health_;
  MeshService mesh_service_;
  JobService job_service_;
  OptimiseService optimise_service_;
  Metrics* const metrics_;
  std::unique_ptr<SocketLock> socket_lock_;  ///< Null unless the server listens on a unix socket.
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<TcpListener> listener_;  ///< Null unless the server listens on TCP.
  std::string address_;
  int port_ = 0;
};

}  // namespace varimesh::server
