// A queue of tasks and its threads.
#include "server/resources/pool.h"

namespace varimesh::server {

Pool::Pool(int threads) {
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { run(); });
}

Pool::~Pool() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  ready_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Pool::post(std::function<void()> task, const std::string& caller) {
  {
    std::lock_guard lock(mutex_);
    auto& tasks = tasks_[caller];
    if (tasks.empty()) turns_.push_back(caller);
    tasks.push_back(std::move(task));
  }
  ready_.notify_one();
}

void Pool::run() {
  while (true) {
    std::function<void()> task;
    {
      std::unique_lock lock(mutex_);
      ready_.wait(lock, [this] { return stopping_ || !turns_.empty(); });
      if (turns_.empty()) return;
      const auto next = tasks_.find(turns_.front());
      turns_.pop_front();
      task = std::move(next->second.front());
      next->second.pop_front();
      if (next->second.empty())
        tasks_.erase(next);
      else
        turns_.push_back(next->first);
    }
    task();
  }
}

}  // namespace varimesh::server
