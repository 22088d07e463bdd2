// Threads that call a function at regular intervals.
#include "server/upkeep.h"

#include <malloc.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

#include "server/notify.h"

namespace varimesh::server {
namespace {

/// How long a server that is full counts as alive although it does not reach itself.
constexpr std::chrono::minutes kLongestFull{10};

}  // namespace

/// Calls a function at regular intervals, on a thread of its own.
class Upkeep::Ticker {
 public:
  Ticker(std::chrono::milliseconds interval, std::function<void()> tick)
      : thread_([this, interval, tick = std::move(tick)] {
          std::unique_lock lock(mutex_);
          while (!stopped_.wait_for(lock, interval, [this] { return stopping_; })) {
            lock.unlock();
            tick();
            lock.lock();
          }
        }) {}
  ~Ticker() {
    {
      std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    stopped_.notify_all();
    thread_.join();
  }

 private:
  std::mutex mutex_;
  std::condition_variable stopped_;
  bool stopping_ = false;
  std::thread thread_;
};

Upkeep::Upkeep(Scheduler& scheduler, Stores& stores, Access& access, Endpoint& endpoint, SelfCheck& self_check,
               LastGoodFiles* tls, Webhooks& webhooks, Watchdog watchdog) {
  using std::chrono::milliseconds, std::chrono::seconds, std::chrono::minutes;
  streams_ = std::make_unique<Ticker>(milliseconds(250), [&endpoint] { endpoint.tick(); });
  jobs_ = std::make_unique<Ticker>(seconds(1), [&scheduler, &stores, &endpoint] {
    scheduler.tick();
    endpoint.health().set_serving(stores.meshes().has_room());
  });
  tokens_ = std::make_unique<Ticker>(seconds(1), [&access] {
    const auto read = access.refresh();
    if (!read)
      spdlog::error("{} The tokens stay as they were.", read.error().sentence);
    else if (*read)
      spdlog::info("the tokens were read again");
    access.note_left_out();
  });
  keys_ = std::make_unique<Ticker>(seconds(1), [&access] {
    const auto fetched = access.fetch_keys();
    if (!fetched)
      spdlog::error("{} The keys stay as they were.", fetched.error().sentence);
    else if (*fetched)
      spdlog::info("the keys of the issuer were fetched");
  });
  certificates_ = std::make_unique<Ticker>(seconds(1), [tls] {
    const auto read = tls == nullptr ? Expected<bool>(false) : tls->refresh();
    if (!read)
      spdlog::error("{} The certificates stay as they were.", read.error().sentence);
    else if (*read)
      spdlog::info("the certificates were read again");
  });
  receivers_ = std::make_unique<Ticker>(seconds(1), [&webhooks] {
    const auto read = webhooks.refresh();
    if (!read)
      spdlog::error("{} The receivers of webhooks stay as they were.", read.error().sentence);
    else if (*read)
      spdlog::info("the receivers of webhooks were read again");
  });
  const auto now = [] { return std::chrono::steady_clock::now(); };
  dialling_ = std::make_unique<Ticker>(
      seconds(5), [&self_check, &endpoint, watchdog, now, answered = now(), reached = now()]() mutable {
        self_check.dial();
        if (self_check.answers()) answered = now();
        // A new server would be as full as this one in a moment, and the open calls would be lost. But a server that
        // hangs fills up too.
        if (self_check.answers() || (endpoint.is_full() && now() - answered < kLongestFull)) {
          reached = now();
          notify_manager("WATCHDOG=1");
        } else if (watchdog.patience.count() > 0 && watchdog.lost && now() - reached >= watchdog.patience) {
          spdlog::error("the server has not reached itself for {} s, and ends", (now() - reached) / seconds(1));
          std::exchange(watchdog.lost, nullptr)();
        }
      });
  // Otherwise the process keeps what a flood of large messages took.
  memory_ = std::make_unique<Ticker>(seconds(10), [] { ::malloc_trim(0); });
  sweeping_ = std::make_unique<Ticker>(minutes(1), [&stores] { stores.meshes().sweep(); });
  compression_ = std::make_unique<Ticker>(minutes(1), [this, &stores] {
    ::setpriority(PRIO_PROCESS, 0, 19);  // applies to this thread only: the running jobs go first
    if (!stores.meshes().compresses()) return;
    if (const auto needed = stores.jobs().needed_digests())
      stores.meshes().compress_idle(*needed, [this] { return stopping_.load(); });
  });
}

Upkeep::~Upkeep() { stopping_ = true; }

void Upkeep::stop_jobs() {
  stopping_ = true;
  jobs_.reset();
  compression_.reset();
  dialling_.reset();
}

}  // namespace varimesh::server
