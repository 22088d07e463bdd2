// A proxy in front of the server that cuts connections, to test that clients continue and to count what they must send
// again.
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

/// Forwards the data of connections to a unix socket, and cuts each connection after a random number of bytes. From
/// then on it reads what the client sends and forwards nothing; when the client stops sending, it closes both ends.
class CuttingProxy {
 public:
  /// Cuts each connection after 1 to `longest` bytes to the server.
  CuttingProxy(std::filesystem::path listen, std::filesystem::path server, std::int64_t longest);
  ~CuttingProxy();
  CuttingProxy(const CuttingProxy&) = delete;
  CuttingProxy& operator=(const CuttingProxy&) = delete;

  int cuts() const { return cuts_; }
  /// The largest number of bytes that a client has sent without an acknowledgement.
  std::int64_t most_held() const { return most_held_; }

 private:
  struct Connection;

  void run();
  void accept();
  /// Forwards data. Returns false if the connection has ended.
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
