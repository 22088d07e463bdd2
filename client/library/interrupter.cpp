#include "client/library/interrupter.h"

#include <chrono>

namespace varimesh::client {

Interrupter::Interrupter(std::function<bool()> interrupted)
    : interrupted_(std::move(interrupted)), thread_([this] { poll(); }) {}

Interrupter::~Interrupter() {
  {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Interrupter::poll() {
  std::unique_lock lock(mutex_);
  while (!closing_) {
    if (calls_.empty()) {
      changed_.wait(lock);
      continue;
    }
    if (interrupted_())
      for (grpc::ClientContext* call : calls_) call->TryCancel();
    changed_.wait_for(lock, std::chrono::milliseconds(50));
  }
}

Interrupter::Registration::Registration(Interrupter* interrupter, grpc::ClientContext* call)
    : interrupter_(interrupter), call_(call) {
  if (interrupter_ == nullptr) return;
  const std::lock_guard lock(interrupter_->mutex_);
  interrupter_->calls_.insert(call_);
  interrupter_->changed_.notify_all();
}

Interrupter::Registration::~Registration() {
  if (interrupter_ == nullptr) return;
  const std::lock_guard lock(interrupter_->mutex_);
  interrupter_->calls_.erase(call_);
}

}  // namespace varimesh::client
