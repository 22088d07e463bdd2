// The sockets of requests, which civetweb keeps to itself.
#pragma once

#include <map>
#include <memory>
#include <mutex>

struct mg_request_info;

namespace varimesh::server {

/// The socket of a request: the one between its two ports; -1: it was not found.
int socket_of(const mg_request_info& request);

/// The sockets of requests that take long, so that a server that stops need not wait for their clients. Thread-safe.
class OpenSockets {
 public:
  /// Counts a socket among them until the returned pointer is released, which must happen before the socket is closed.
  /// @param socket  negative: none
  std::shared_ptr<const void> add(int socket);
  /// Shuts all of them down, and those that are added later: whoever reads or writes there finds that the client is
  /// gone.
  void shut_down();

 private:
  std::mutex mutex_;
  std::map<int, int> open_;  ///< How often each was added.
  bool is_down_ = false;
};

}  // namespace varimesh::server
