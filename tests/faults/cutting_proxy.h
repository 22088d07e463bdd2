// A way to the server that breaks: for clients that must go on, and to count what they have to send again.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <random>
#include <thread>
#include <vector>

namespace varimesh::server::testing {

/// Hands on what comes over a unix socket, and cuts each connection at random: behind a number of bytes it takes what
/// the client sends and hands nothing on, until the client sends no more; then both ends are closed.
class CuttingProxy {
 public:
  /// Cuts behind 1 to `longest` bytes on their way to the server.
  CuttingProxy(std::filesystem::path listen, std::filesystem::path server, std::int64_t longest);
  ~CuttingProxy();
  CuttingProxy(const CuttingProxy&) = delete;
  CuttingProxy& operator=(const CuttingProxy&) = delete;

  int cuts() const { return cuts_; }
  /// The most bytes that a client sent and nobody acknowledged.
  std::int64_t most_held() const { return most_held_; }

 private:
  struct Connection;

  void run();
  void accept();
  /// False where the connection is over.
  bool serve(Connection& connection, short client_events, short server_events);

  const std::filesystem::path path_, server_;
  const std::int64_t longest_;
  std::mt19937 random_{1};
  int listener_;
  std::vector<std::unique_ptr<Connection>> connections_;
  std::atomic<int> cuts_ = 0;
  std::atomic<std::int64_t> most_held_ = 0;
  std::atomic<bool> closing_ = false;
  std::thread thread_;
};

}  // namespace varimesh::server::testing
