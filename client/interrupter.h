// Ends calls from outside: one that waits for a server which hangs would not notice that its caller wants to stop.
#pragma once

#include <grpcpp/client_context.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <set>
#include <thread>

namespace varimesh::client {

/// Asks `interrupted` a few times a second while calls are under way, and cancels them all once it is true.
class Interrupter {
 public:
  explicit Interrupter(std::function<bool()> interrupted);
  ~Interrupter();
  Interrupter(const Interrupter&) = delete;
  Interrupter& operator=(const Interrupter&) = delete;

  /// Keeps an eye on a call as long as this exists; a null interrupter keeps none.
  class Eye {
   public:
    Eye(Interrupter* interrupter, grpc::ClientContext* call);
    ~Eye();
    Eye(const Eye&) = delete;
    Eye& operator=(const Eye&) = delete;

   private:
    Interrupter* const interrupter_;
    grpc::ClientContext* const call_;
  };

 private:
  void run();

  const std::function<bool()> interrupted_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::set<grpc::ClientContext*> calls_;
  bool closing_ = false;
  std::thread thread_;
};

}  // namespace varimesh::client
