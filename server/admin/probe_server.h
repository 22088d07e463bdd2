// The port for probes and metrics, which programs outside this machine may reach.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "server/http/listen.h"

namespace varimesh::server {

/// An HTTP server with threads of its own, which says nothing about single jobs, owners or meshes.
///
///   GET /metrics                the metrics, in the text format of Prometheus
///   GET /healthz/live           200 as long as the process answers
///   GET /healthz/ready          200 if the server accepts jobs, otherwise 503
///
/// Other methods get 405. The metrics are measured at most once a second, however often they are asked for.
class ProbeServer {
 public:
  /// Listens on HOST:PORT. `ready`: whether the server accepts jobs. `metrics`: measures; empty if this build cannot.
  /// Errors: BadOption for an address without a port, Output if the address is taken.
  static Expected<std::unique_ptr<ProbeServer>> start(const std::string& address, std::function<bool()> ready,
                                                      std::function<std::string()> metrics);

  /// The address with the port that was chosen.
  const std::string& address() const { return http_.address(); }

 private:
  ProbeServer(std::function<bool()> ready, std::function<std::string()> metrics)
      : ready_(std::move(ready)), metrics_(std::move(metrics)) {}
  static int handle(mg_connection* connection);
  void answer(mg_connection* connection);
  std::string measured();

  const std::function<bool()> ready_;
  const std::function<std::string()> metrics_;
  std::mutex mutex_;  ///< Held while it is measured, so that other threads wait for the same text.
  std::string text_;
  std::chrono::steady_clock::time_point time_{};
  HttpServer http_;  ///< The last member, so that its threads end first.
};

}  // namespace varimesh::server
