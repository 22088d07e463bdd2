// Calls the webhooks of jobs that have ended.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/jobs/job_store.h"
#include "server/webhooks/receivers.h"
#include "server/webhooks/webhook_settings.h"

namespace varimesh::server {

/// Claims the calls that are due in the job store, and makes them, on threads of its own. The store keeps them until
/// they were delivered or given up, so a call is made at least once, by this server or another one. A receiver that
/// hangs holds up no others. Thread-safe.
class Webhooks {
 public:
  /// Reads the file. Errors: BadOption if it cannot be used. `counted`: called with the end of each call.
  static Expected<std::unique_ptr<Webhooks>> start(JobStore& jobs, WebhookSettings settings,
                                                   std::function<TimePoint()> clock,
                                                   std::function<void(CallEnd)> counted);
  /// Gives up the calls that are under way, which are made again later.
  ~Webhooks();

  /// Whether jobs may have webhooks.
  bool are_taken() const { return !settings_.file.empty(); }
  /// As check_webhook().
  Answer<void> check(const v1::Webhook& webhook) const;
  /// A job has ended.
  void wake();
  /// Called regularly, by one thread: reads the file again if it has changed, and returns whether it did. Errors: as
  /// start(), once for each change; then the receivers stay as they were.
  Expected<bool> refresh();

 private:
  Webhooks(JobStore& jobs, WebhookSettings settings, std::function<TimePoint()> clock,
           std::function<void(CallEnd)> counted);
  std::shared_ptr<const Receivers> receivers() const;
  void work();
  /// Makes one call if one is due. Returns whether there may be more.
  bool call_next();
  CallOutcome call(const v1::Job& job);
  CallOutcome failed(const v1::Job& job, const std::string& sentence, bool for_good = false) const;
  /// A place at a receiver, of which only few are called at a time; null: it has none.
  std::shared_ptr<const void> place_at(const std::string& origin);

  JobStore& jobs_;
  const WebhookSettings settings_;
  const std::function<TimePoint()> clock_;
  const std::function<void(CallEnd)> counted_;
  mutable std::mutex mutex_;
  std::condition_variable woken_;
  bool stopping_ = false;
  int news_ = 0;  ///< How often wake() was called.
  std::shared_ptr<const Receivers> receivers_;
  std::string text_;                      ///< Of the file, when it was last read.
  std::map<std::string, int> under_way_;  ///< Calls by receiver.
  std::vector<std::thread> threads_;
};

}  // namespace varimesh::server
