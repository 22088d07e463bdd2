// The whole service in one object: what main() starts, and what a command without --server runs in its own process.
#pragma once

#include <grpcpp/channel.h>

#include <chrono>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "server/jobs/engine.h"
#include "server/jobs/job_store.h"
#include "server/operations/limits.h"

namespace varimesh::server {

/// Settings of a server; the defaults listen nowhere and take the whole machine.
struct ServerOptions {
  std::string listen;     ///< HOST:PORT (port 0: a free one) or unix:PATH; empty: in-process channels only.
  std::string admin;      ///< HOST:PORT on loopback for health and the page that watches; empty: none.
  bool insecure = false;  ///< Said aloud: listen beyond loopback without TLS.
  std::string state;      ///< Directory of jobs and meshes that outlive the server; empty: they go with it.
  std::string
      data;  ///< Without `state`: where to make the directory for meshes; empty: the system's for temporary files.
  Limits limits;
  Engine engine;  ///< What runs the jobs: core_engine(), or a test's.
  std::function<TimePoint()> clock = std::chrono::system_clock::now;
  std::function<std::string()> new_name;  ///< Empty: random names.
};

/// A running server.
class Server {
 public:
  /// Listens and serves; jobs that another server left behind in `state` go on. Errors: BadOption for an address that
  /// may not be listened on, Output where it is taken, or the state cannot be used.
  static Expected<std::unique_ptr<Server>> start(ServerOptions options);
  /// Stops as stop() does, if that was not done.
  ~Server();

  /// Where it listens, with the port that was chosen; empty for none.
  const std::string& address() const;
  int port() const;
  /// Where the admin port listens; empty for none.
  const std::string& admin_address() const;
  std::shared_ptr<grpc::Channel> in_process_channel();

  /// Ends everything in order: NOT_SERVING, no new jobs, those that run are left for the next server where they outlive
  /// this one and cancelled where not, finishes every stream with UNAVAILABLE, shuts down. False where a job had not
  /// ended by itself after `patience`; then the process should leave at once.
  bool stop(std::chrono::milliseconds patience);

 private:
  struct Parts;
  explicit Server(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

/// Whether an address means this machine alone: 127.0.0.0/8, ::1, localhost, or a unix socket.
bool is_loopback(const std::string& address);

}  // namespace varimesh::server
