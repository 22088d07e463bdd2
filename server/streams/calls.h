// The open streams of a server. All of them must be finished before the server shuts down: grpc::Server::Shutdown does
// not return while a reactor exists, not even after its deadline.
#pragma once

#include <grpcpp/support/status.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <set>

namespace varimesh::server {

/// An open stream.
class Call {
 public:
  virtual ~Call() = default;
  /// Finishes the stream with this status if it is not finished yet. Thread-safe.
  virtual void end(const grpc::Status& status) = 0;
  /// Called a few times per second, to check whether the client has stalled or a bookmark is due.
  virtual void tick(std::chrono::steady_clock::time_point) {}
};

/// All open streams of a server. Thread-safe.
class CallRegistry {
 public:
  /// Returns false after end_all() was called. Then the caller must finish the call at once.
  bool add(const std::shared_ptr<Call>& call);
  void remove(const std::shared_ptr<Call>& call);
  /// Ends all streams; add() refuses later ones.
  void end_all(const grpc::Status& status);
  void tick(std::chrono::steady_clock::time_point now);
  /// Waits until no stream is open. Returns false if some are still open at the deadline.
  bool wait_empty(std::chrono::steady_clock::time_point deadline);
  std::size_t size();

 private:
  std::mutex mutex_;
  std::condition_variable emptied_;
  std::set<std::shared_ptr<Call>> calls_;
  bool closed_ = false;
};

}  // namespace varimesh::server
