// Threads for work that may take time, such as disk access, hashing and parsing, which gRPC's threads must not do.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace varimesh::server {

/// A fixed number of threads that run tasks. Those of one caller run in the order in which they are posted, and callers
/// take turns: however many tasks one of them has posted, the next task is another's.
class Pool {
 public:
  explicit Pool(int threads);
  /// Runs all posted tasks, then joins the threads.
  ~Pool();
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  /// `task` must not throw.
  void post(std::function<void()> task, const std::string& caller = {});

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable ready_;
  std::map<std::string, std::deque<std::function<void()>>> tasks_;
  std::deque<std::string> turns_;  ///< Callers that have tasks, in the order in which they are served.
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace varimesh::server
