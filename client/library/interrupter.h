// Ends calls to the server when the caller wants to stop. A thread does that, because a call that waits for a server
// that hangs cannot check anything.
#pragma once

#include <grpcpp/client_context.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <set>
#include <thread>

namespace varimesh::client {

/// A thread that asks `interrupted` every 50 ms while calls are under way, and cancels all of them once it is true. The
/// thread sleeps while there are no calls.
class Interrupter {
 public:
  explicit Interrupter(std::function<bool()> interrupted);
  ~Interrupter();
  Interrupter(const Interrupter&) = delete;
  Interrupter& operator=(const Interrupter&) = delete;

  /// Has a call cancelled on an interrupt as long as this object exists. A null interrupter is allowed and does
  /// nothing.
  class Registration {
   public:
    Registration(Interrupter* interrupter, grpc::ClientContext* call);
    ~Registration();
    Registration(const Registration&) = delete;
    Registration& operator=(const Registration&) = delete;

   private:
    Interrupter* const interrupter_;
    grpc::ClientContext* const call_;
  };

 private:
  void poll();

  const std::function<bool()> interrupted_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::set<grpc::ClientContext*> calls_;
  bool closing_ = false;
  std::thread thread_;
};

}  // namespace varimesh::client
