// A set under a lock. The lock is never held while a call is used.
#include "server/streams/calls.h"

#include <vector>

namespace varimesh::server {

bool CallRegistry::add(const std::shared_ptr<Call>& call) {
  std::lock_guard lock(mutex_);
  calls_.insert(call);
  return !closed_;
}

void CallRegistry::remove(const std::shared_ptr<Call>& call) {
  std::lock_guard lock(mutex_);
  calls_.erase(call);
  if (calls_.empty()) emptied_.notify_all();
}

void CallRegistry::end_all(const grpc::Status& status) {
  std::vector<std::shared_ptr<Call>> calls;
  {
    std::lock_guard lock(mutex_);
    closed_ = true;
    calls.assign(calls_.begin(), calls_.end());
  }
  for (const auto& call : calls) call->end(status);
}

void CallRegistry::tick(std::chrono::steady_clock::time_point now) {
  std::vector<std::shared_ptr<Call>> calls;
  {
    std::lock_guard lock(mutex_);
    calls.assign(calls_.begin(), calls_.end());
  }
  for (const auto& call : calls) call->tick(now);
}

bool CallRegistry::wait_empty(std::chrono::steady_clock::time_point deadline) {
  std::unique_lock lock(mutex_);
  return emptied_.wait_until(lock, deadline, [this] { return calls_.empty(); });
}

std::size_t CallRegistry::size() {
  std::lock_guard lock(mutex_);
  return calls_.size();
}

}  // namespace varimesh::server
