// The streams that are open, so that all can be finished before the server shuts down: grpc::Server::Shutdown does not
// return while a reactor lives, deadline or not.
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
  /// Finishes the stream with this status unless it is finished. From any thread.
  virtual void end(const grpc::Status& status) = 0;
  /// Now and then: time to see whether the reader is stalled or wants a sign of life.
  virtual void tick(std::chrono::steady_clock::time_point) {}
};

/// All open streams of a server.
class CallRegistry {
 public:
  /// False once end_all() was called: finish the call at once.
  bool add(const std::shared_ptr<Call>& call);
  void remove(const std::shared_ptr<Call>& call);
  /// Ends every stream, and those that come later are refused.
  void end_all(const grpc::Status& status);
  void tick(std::chrono::steady_clock::time_point now);
  /// False where streams are left at the deadline.
  bool wait_empty(std::chrono::steady_clock::time_point deadline);
  std::size_t size();

 private:
  std::mutex mutex_;
  std::condition_variable emptied_;
  std::set<std::shared_ptr<Call>> calls_;
  bool closed_ = false;
};

}  // namespace varimesh::server
