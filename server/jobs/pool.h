// Threads for what a reaction must not do itself: disk, hashing, parsing, waiting.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace varimesh::server {

/// A fixed number of threads that run what is posted, in order of arrival.
class Pool {
 public:
  explicit Pool(int threads);
  /// Runs what was posted, then joins.
  ~Pool();
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  /// `task` must not throw.
  void post(std::function<void()> task);

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable ready_;
  std::deque<std::function<void()>> tasks_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace varimesh::server
