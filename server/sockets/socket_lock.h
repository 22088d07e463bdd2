// Makes sure that only one server listens on a unix socket.
#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// Holds the lock of a unix socket until it is destroyed or the process ends for whatever reason. gRPC removes a socket
/// that is in its way, and so a second server would take the clients of the first one without a word. The lock is a
/// file beside the socket, PATH.lock, which is removed with the lock.
class SocketLock {
 public:
  /// `address`: unix:PATH or unix:///PATH. A socket that no process listens on any more does not matter. Errors: Output
  /// if another process listens on the socket, or if the lock file cannot be created.
  static Expected<std::unique_ptr<SocketLock>> take(const std::string& address);
  ~SocketLock();
  SocketLock(const SocketLock&) = delete;
  SocketLock& operator=(const SocketLock&) = delete;

 private:
  SocketLock(std::string path, int file) : path_(std::move(path)), file_(file) {}

  const std::string path_;  ///< Of the lock file.
  const int file_;
};

}  // namespace varimesh::server
