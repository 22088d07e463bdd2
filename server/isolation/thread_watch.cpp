#include "server/isolation/thread_watch.h"

#include <chrono>
#include <csignal>
#include <fstream>
#include <string>

namespace varimesh::server {
namespace {

/// 0 if the process has ended.
int threads_of(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/status");
  for (std::string word; file >> word;) {
    int count = 0;
    if (word == "Threads:" && file >> count) return count;
  }
  return 0;
}

}  // namespace

ThreadWatch::~ThreadWatch() {
  {
    const std::scoped_lock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void ThreadWatch::add(pid_t process, int computing) {
  const std::scoped_lock lock(mutex_);
  watched_[process] = {computing + kMore};
  if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
  changed_.notify_all();
}

void ThreadWatch::forget(pid_t process) {
  const std::scoped_lock lock(mutex_);
  watched_.erase(process);
}

bool ThreadWatch::has_killed(pid_t process) const {
  const std::scoped_lock lock(mutex_);
  const auto found = watched_.find(process);
  return found != watched_.end() && found->second.killed;
}

void ThreadWatch::run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    for (auto& [process, watched] : watched_) {
      if (watched.killed || threads_of(process) <= watched.most) continue;
      watched.killed = ::kill(process, SIGKILL) == 0;
    }
    if (watched_.empty())
      changed_.wait(lock, [this] { return stopping_ || !watched_.empty(); });
    else
      changed_.wait_for(lock, std::chrono::milliseconds(20), [this] { return stopping_; });
  }
}

}  // namespace varimesh::server
