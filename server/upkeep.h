// The regular work of a running server, each kind on a thread of its own.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>

#include "server/access/access.h"
#include "server/api/endpoint.h"
#include "server/scheduling/scheduler.h"
#include "server/self_check.h"
#include "server/state/stores.h"
#include "server/tls/last_good_files.h"
#include "server/webhooks/webhooks.h"

namespace varimesh::server {

/// What happens if the server does not reach itself any more.
struct Watchdog {
  std::chrono::milliseconds patience{0};  ///< 0: nothing happens.
  std::function<void()> lost;             ///< Called once, after so long without an answer.
};

/// From its construction on: lets streams cancel stalled clients (every 250 ms), renews leases, starts jobs and updates
/// the server's health, reads changed tokens, certificates and receivers of webhooks, and fetches an issuer's keys
/// (every second), dials the server (every 5 s), gives memory back to the system (every 10 s), and deletes old meshes
/// and compresses idle ones (every minute). Everything it is given must outlive it.
class Upkeep {
 public:
  /// `tls`: null for a server that does not encrypt.
  Upkeep(Scheduler& scheduler, Stores& stores, Access& access, Endpoint& endpoint, SelfCheck& self_check,
         LastGoodFiles* tls, Webhooks& webhooks, Watchdog watchdog);
  ~Upkeep();

  /// Stops the threads that start jobs and compress meshes. The others run until this object is destroyed.
  void stop_jobs();

 private:
  class Ticker;

  std::atomic<bool> stopping_ = false;
  std::unique_ptr<Ticker> streams_, jobs_, tokens_, keys_, certificates_, receivers_, memory_, sweeping_, compression_,
      dialling_;
};

}  // namespace varimesh::server
